/* What the estimator puts out for a sample: places of the outputs, states of health, coefficients of loads. */

#ifndef OUTPUTS_H
#define OUTPUTS_H

#include "../map/map_resource.h"

/* Indices of the outputs; their numbers are the value references of FMI 2.0. Integers and the health state are whole
   numbers here too. */
enum {
    COEFFICIENTS = 0,      /* C_A, C_N, C_Y, M_P, M_Y [1] */
    COEFFICIENTS_STD = 5,  /* [1] */
    LOADS = 10,            /* axial, normal, side force; pitching, yawing moment [N, N m] */
    LOADS_STD = 15,        /* [N, N m] */
    HEALTH_STATE = 20,
    CHI_SQUARE = 21,       /* [1] */
    CHI_SQUARE_LIMIT = 22, /* [1] */
    VALID_GAUGES = 23,     /* number of gauges in use */
    SUSPECT_GAUGE = 24,    /* the first suspect, from 1; 0 for none */
    SUSPECTS = 25,         /* gauges that share the suspicion */
    ENVELOPE_SCORE = 26,   /* [1] */
    N_OUTPUTS = 27
};

/* States of health: strainfmu/estimator/health.py. */
enum { OK, INCONSISTENT, NO_COEFFICIENTS, INVALID, DEGRADED, UNIDENTIFIED, SUSPECT, OUTSIDE };

/* Whether loads may be used with their stated standard deviations in a state of health. */
static inline int is_usable(double health) {
    return health == (double)OK || health == (double)DEGRADED;
}

/* Factors of coefficients at q_inf [Pa]: 1 / (q S) for the three forces, 1 / (q S L) for the two moments. */
void coefficient_scales(double pressure, double area, double length, double *scale);

/* No number, for outputs from `first` up to, not including, `end`; for all but counts and health. */
void set_unknown_from(double *output, int first, int end);
void set_unknown(double *output);

/* M_P' = M_P + shift F_N and M_Y' = M_Y + shift F_Y about a point further aft. */
static inline void move_moments(double shift, double *loads) {
    loads[3] += shift * loads[1];
    loads[4] += shift * loads[2];
}

/* Variance of moment `load` about the shifted point, and in *with_force its covariance with the force that comes in:
   of B C B' the entries that are needed. */
static inline double moved_variance(const double *covariance, size_t load, double shift, double *with_force) {
    const size_t force = load - 2;
    const double cross = covariance[load * N_LOADS + force], of_force = covariance[force * N_LOADS + force];
    *with_force = cross + shift * of_force;
    return (covariance[load * N_LOADS + load] + shift * cross) + shift * *with_force;
}

#endif
