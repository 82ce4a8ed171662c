/* The filter over time of a linear map.

   The equations are those of strainfmu/estimator/reference/linear_filter.py. Arrays over gauges and
   states are in lanes; a gauge that is not in use reads nothing, with a noise of 1. */

#ifndef LINEAR_FILTER_H
#define LINEAR_FILTER_H

#include "../map/linear_filter_map.h"
#include "law.h"

/* What a sample leaves to the next one, beside the law; all of it float64, as serialised. */
typedef struct {
    double has_law; /* 0 or 1 */
    double time;    /* of the sample of the law [s] */
    double now;     /* of the sample that follows [s] */
    double stepped; /* whether the outputs are those of a step that has been taken */
} LinearTrack;

typedef struct {
    int present; /* whether the map has one; if not, nothing else is set */
    LinearFilterMap map;
    void *memory;
    Laws laws;                 /* states that scale with q_inf, others in common, modes; own errors, then the rest */
    size_t n_gauges, rows;     /* rows: n_gauges in lanes */
    LinearTrack base, next;    /* that the outputs follow from, and that they leave */
    double *own_covariance, *rest_covariance; /* (rows, rows) of the considered errors */
    /* Of a sample. */
    double ratio;              /* of q_inf to nominal */
    unsigned char *used;       /* (n_gauges) */
    double *apart;             /* (rows) strain less that of the mean pressure */
    double *read;              /* (order, rows) H' */
    double *term;              /* (n_considered, rows) G' */
    double *white;             /* (rows, rows) covariance of noise and considered errors */
    double *of_load;           /* (5, order) change of the loads per state, with what the residual says of the rest */
    double alone[N_LOADS];     /* loads of the law after the sample alone, less those of no state, */
    double alone_covariance[N_LOADS * N_LOADS];
    double change[N_LOADS * N_LOADS]; /* of the covariance of the loads by earlier samples, about the moment point of */
    int has_change;                   /* the settings; whether the outputs have it */
    /* Scratch. */
    double *read_turned;       /* (rows, order) H */
    double *term_turned;       /* (rows, n_considered) G */
    double *factor;            /* (rows, rows) */
    double *small;             /* (order, order) */
    double *considered;        /* (order, rows) C G' */
    double *gain;              /* (order + LANES + 5, rows) */
    double *product;           /* (order, rows) */
    double *turned;            /* (rows or order, order) */
    double *kept;              /* (order, order) K H */
    double *joseph;            /* (3, order, order) */
} LinearFilter;

/* Read the part, if there is one, and allocate. 1; 0 after a message. The first n_strains gauges have zeros. */
int linear_filter_create(MapFile *file, size_t n_gauges, size_t n_strains, int wide, LinearFilter *filter,
                         const Thermal *thermal);
void linear_filter_free(LinearFilter *filter);

/* Forget all samples. */
void linear_filter_reset(LinearFilter *filter);

/* filter->laws.predicted from filter->laws.law, over a time step [s], with a time constant [s]. */
void linear_filter_predict(LinearFilter *filter, double time_step, double time_constant);

/* The state: the track, then the law; whether such bytes may be read. */
size_t linear_filter_state_size(const LinearFilter *filter);
void linear_filter_write_state(const LinearFilter *filter, unsigned char *bytes);
int linear_filter_state_fits(const LinearFilter *filter, const unsigned char *bytes);
void linear_filter_read_state(LinearFilter *filter, const unsigned char *bytes);

#endif
