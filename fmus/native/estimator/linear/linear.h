/* The linear estimator: outputs of a sample, and the conditions that its health follows from. */

#ifndef LINEAR_H
#define LINEAR_H

#include "../update/update.h"

/* What is known of the flow in a step. */
typedef struct {
    int known;        /* whether the dynamic pressure gives coefficients */
    double pressure;  /* [Pa] */
    double deviation; /* of its error [Pa]; 0 where it is not known */
    double mach_number, altitude; /* [1], [m]; NaN where not known */
    double mach_deviation; /* stated, of the Mach number [1]; 0 for none */
} Flow;

/* What the linear estimator holds: the map's matrices for the gauges in use, and the numbers of the last step. */
typedef struct {
    const Map *map;
    const Inputs *inputs;
    double *output;        /* (N_OUTPUTS) of the estimator */
    OtherLoads *other_loads;      /* loads in addition to the five, of a map that has some */
    int wide;              /* wide_of_processor() */
    Flow flow;             /* of the inputs since output was computed */
    int conditions;        /* of the sample, bits of sample.h */
    Prepared prepared;
    double *products;      /* (n_half_spaces, 15) n_i n_j of each half-space, doubled off the diagonal, in panels of numerics.h */
    double *variance;      /* (dense_rows(n_half_spaces)) scratch */
    Scaled scaled;
} Linear;

/* Hand out the arrays, filled in. */
void half_space_arrays(const Envelope *envelope, Linear *linear, Room *room);

/* Condition the loads on the strains, and set all outputs but the number of gauges and the health, where the gauges in use
   identify the state; of form "dynamic_pressure" where q_inf is known. */
void linear_outputs(Linear *linear);

/* Set linear->other_loads->value for the last step. */
void linear_other_loads_update(Linear *linear);

/* Variances of load k and of its coefficient, whose outputs are set, by gauge noise (n_gauges) and a part of the variance of
   q_inf. gain takes (2, linear_noise_row). */
size_t linear_noise_row(const Map *map);
void linear_noise(Linear *linear, size_t k, const double *gauge_noise, double of_pressure, double *gain, double noise[2]);

/* Hand out the arrays; map, other_loads and wide are set. */
void linear_arrays(Map *map, size_t n_strains, Linear *linear, Room *room);

/* Give the map its matrices. 0 if the covariance of its gauges is none. */
int linear_begin(Linear *linear);

/* After the last added_noise_part: the map has other matrices, and what follows from them. */
void linear_renewed(Linear *linear);

/* Set all outputs but health for the present inputs, and linear->conditions. */
void linear_update(Linear *linear);

/* Write loads and coefficients at a dynamic pressure and its standard deviation to the outputs. 1; 0, and they keep
   their values, if the map has none. */
int linear_loads_at(Linear *linear, double dynamic_pressure, double deviation);

#endif
