/* Parts of a step that both forms of a map have in common. */

#ifndef STEP_PARTS_H
#define STEP_PARTS_H

#include "estimator.h"

/* Factors of coefficients at q_inf [Pa]: 1 / (q S) for the three forces, 1 / (q S L) for the two moments. */
void coefficient_scales(double pressure, double area, double length, double *scale);

/* No number, for outputs from `first` up to, not including, `end`; for all but counts and health. */
void set_unknown_from(double *output, int first, int end);
void set_unknown(double *output);

/* An input of flow or navigation; NaN where it is not given: 0, which hosts fill in, or below, or NaN. */
double known_input(const Estimator *e, size_t scalar);

/* How much further aft the moment point is than that of the map [m]. */
double moment_shift(const Estimator *e);

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

/* Loads about the moment point of the map, their covariance and their derivative by q_inf. */
typedef struct {
    const double *loads, *covariance, *per_pressure;
} LoadStatistics;

/* Coefficients at the references of the map, and their covariance. */
void map_coefficients(const Estimator *e, const LoadStatistics *found, double *coefficients, double *covariance);

/* The output ENVELOPE_SCORE, where the dynamic pressure is known. */
void set_envelope_score(Estimator *e, const LoadStatistics *found);

#endif
