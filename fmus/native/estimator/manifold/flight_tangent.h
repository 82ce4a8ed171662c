/* How the solution changes with strain, navigation and priors: strainfmu/estimator/manifold/derivative.py.

   At the state where the iterations end F = J' S^-1 r + H' W nu is zero. With F_x all of its derivative by the state,
   second derivatives of the tables and the change of S in it, dx = -F_x^-1 F_y dy. Everything else follows from dx and
   from products with the vectors w = S^-1 [r, J, C']: C is the covariance of loads and strain off the tables. */

#ifndef FLIGHT_TANGENT_H
#define FLIGHT_TANGENT_H

#include "../tables/flight_curvature.h"
#include "flight_solve.h"

#define N_WEIGHTED (N_RIGHT + N_LOADS)

/* What a solution's derivatives have in common, whatever changes. */
typedef struct {
    int outdated;          /* whether the solution is another one */
    int ended;             /* whether the iterations have ended, so that F is zero */
    Curvature curvature;
    double *weighted;      /* (N_WEIGHTED, n) w */
    double *scaled;        /* (N_WEIGHTED, n) scratch */
    double *own, *columns; /* (n), (n_common + 1, n) scratch: changes of what proportional_errors has */
    double with_jacobian[N_WEIGHTED][N_STATES];                /* w' J */
    double with_curvature[N_WEIGHTED][N_STATES][N_STATES];     /* w' second derivatives of strain */
    double with_covariance[N_STATES][N_WEIGHTED][N_WEIGHTED];  /* w' dS w by the state */
    double with_residual[N_LOADS], with_load[N_LOADS][N_LOADS]; /* C S^-1 r, C S^-1 C' */
    double by_state[N_STATES][N_STATES];                        /* -F_x */
} Tangents;

/* The same of a further load: of its covariance c with strain and w = S^-1 c. */
typedef struct {
    double with_residual, with_load;                 /* c S^-1 r, c S^-1 c */
    double with_jacobian[N_STATES];
    double with_curvature[N_STATES][N_STATES];
    double with_covariance[N_STATES][N_RIGHT + 1];   /* w' dS of S^-1 [r, J], then of w, by the state */
} LoadProducts;

typedef struct {
    Curvature curvature;
    double *weighted;       /* (n_loads, n) w */
    LoadProducts *products; /* (n_loads) */
} FurtherTangents;

/* Changes of strain (n), and of the values and precisions of navigation and priors. */
typedef struct {
    const double *strain;
    double value[N_MEASURED], precision[N_MEASURED];
} SampleChange;

/* Those of the solution. */
typedef struct {
    double state[N_STATES], state_covariance[N_STATES * N_STATES];
    double loads[N_LOADS], load_covariance[N_LOADS * N_LOADS];
    double coefficients[N_LOADS], coefficient_covariance[N_LOADS * N_LOADS];
    double chi_square;
} SolutionChange;

/* Sum over the gauges, w being 0 for those that are not in use. */
static inline double gauge_dot(const FlightSolver *solver, const double *x, const double *y) {
    double sum = 0.0;
    for (size_t g = 0; g < solver->n_gauges; g++) {
        sum += x[g] * y[g];
    }
    return sum;
}

/* Number of doubles, and handing them out; `widest` are the tables with the most channels. */
size_t tangents_doubles(const FlightMap *map, const TableMap *widest, size_t n_gauges);
void tangents_arrays(const FlightSolver *solver, const FlightTables *widest, Tangents *tangents, double **doubles);

/* Prepare for the present solution. */
void tangents_prepare(FlightSolver *solver, Tangents *tangents);

/* Changes of the columns that all gauges have in common, and of the variances of each gauge, by the state l, in columns
   and own. */
void tangents_proportional(const FlightSolver *solver, Tangents *tangents, size_t l);

/* Of PressureErrors.wider. */
double tangents_wider(const FlightSolver *solver, const PressureErrors *pressure, const SolutionChange *change);

/* Derivative by M of the row of ln q_inf in the measurement's Jacobian, of its entry M. */
double tangents_row_slope(const FlightSolver *solver);

/* The change of the solution with the sample. */
void tangents_along(const FlightSolver *solver, const Tangents *tangents, const SampleChange *sample,
                    SolutionChange *change);

#endif
