/* Memory of the nonlinear solver, and the errors that its gauges have. */

#ifndef FLIGHT_SOLVER_H
#define FLIGHT_SOLVER_H

#include "../sample/inputs.h"
#include "flight_tables.h"

#define N_RIGHT (1 + N_STATES) /* residual, then the columns of its Jacobian */

/* What is known of a sample. */
typedef struct {
    double *strain;              /* (n) [m/m], 0 of gauges that are not in use */
    unsigned char *used;         /* (n_gauges) */
    double value[N_MEASURED];    /* of navigation and priors */
    double precision[N_MEASURED]; /* 0 where not known */
} Sample;

/* States of the search, in their order: incidences, of each the best is a start; Mach numbers; roll angles. */
#define SEARCH_STARTS 6
#define SEARCH_MACHS 3
#define SEARCH_ROLLS 16
#define SEARCH_STATES (SEARCH_MACHS * SEARCH_ROLLS) /* at each incidence */

/* Iterations to each side of a state, of which navigation does not state the pressure: policies/ambiguity.c. */
#define ASIDE_ITERATIONS 3

/* Other solutions that are looked for where gauges are lost, each by the iterations of a start of the search: mirror images
   and the best other minima of the search's states: policies/ambiguity.c. */
#define MOST_MINIMA 3
#define MOST_OTHERS (4 + MOST_MINIMA)

#define N_WIDENING (N_STATES + 2 * N_LOADS) /* flight state, loads, coefficients */

/* Estimates of a sample, about the map's moment point and references. */
typedef struct {
    double state[N_STATES], state_covariance[N_STATES * N_STATES]; /* by the errors that the gain may correct */
    double loads[N_LOADS], load_covariance[N_LOADS * N_LOADS];
    double coefficients[N_LOADS], coefficient_covariance[N_LOADS * N_LOADS];
    double chi_square;
    double rest_square; /* square of what another iteration would move the state by, in its standard deviations */
    double *standardised_residual; /* (n) */
    double navigation_residual[N_NAVIGATION];
    double widening[N_WIDENING];                       /* factors on standard deviations, for what else fits; 0 for none, */
    double widened_covariance[N_STATES * N_STATES];    /* of the state by all errors, with them, as the loads' */
    double shape_square; /* chi-square of the shapes of pressure off the tables in the residual */
    size_t n_others; /* other solutions that fit, whose squared differences count as variance by these parts */
    double other_part[MOST_OTHERS], other_state[MOST_OTHERS][N_STATES];
} Solution;

/* What a derivative by the state makes of a shift of it. */
static inline double along_state(const double *by_state, const double *shift) {
    double sum = 0.0;
    for (size_t k = 0; k < N_STATES; k++) {
        sum += by_state[k] * shift[k];
    }
    return sum;
}

/* Where a search ended, of what navigation gave with these precisions. */
typedef struct {
    double precision[N_NAVIGATION], end[SEARCH_STARTS][N_STATES], deviance[SEARCH_STARTS];
} KeptEnds;

#define KEPT_SEARCHES 2 /* with all of navigation, and without what is inconsistent */

/* The problem about the state with the considered errors, too: covariances and alarms follow from it. */
typedef struct {
    FlightTables tables; /* of the considered error that has some, in maps that have it */
    Response response;
    double *factor;      /* (n, n) L */
    double *right;       /* (N_RIGHT, n) L^-1 of residual and Jacobian */
    double *turned;      /* (N_LOADS, n) L^-1 of covariances of loads with strain */
    double hessian[N_STATES * N_STATES], gradient[N_STATES], cost;
    double state_covariance[N_STATES * N_STATES];
    double shift[N_STATES]; /* its estimate of the state, less the state */
} FullModel;

/* Arrays are by gauge, `n` of them: n_gauges in lanes. */
typedef struct {
    const FlightMap *map;
    size_t n_gauges, n;
    int wide;
    FlightTables tables;
    double *gauge_covariance, *scaled_covariance, *considered_covariance; /* (n, n) */
    double *search_strain;                        /* (SEARCH_STARTS, SEARCH_STATES, n) per p_inf [1/Pa], */
    double *search_whitened;                      /* and L^-1 of it, */
    double *search_factor;                        /* (n, n) L of S in the middle of the grid */
    double search_mach[SEARCH_MACHS], search_crossflow[SEARCH_STARTS][2];
    double search_cosine[SEARCH_ROLLS], search_sine[SEARCH_ROLLS];
    double *search_weight;                        /* (n) 1 over the standard deviation of each gauge */
    double *search_slope[2];                      /* (n) of strain by u and w in the middle of the ranges, per p_inf [1/Pa] */
    MeasuredAngles angles;
    Sample sample;
    Solution solution;
    FullModel full;
    /* Scratch: the problem about a state. */
    double state[N_STATES];
    Response response;
    double *factor;              /* (n, n) L */
    double factor_pressure;      /* p_inf that it belongs to [Pa], */
    double factor_state[N_STATES]; /* and the state */
    double *inverse;             /* (n, n) L^-1 */
    double *right;               /* (N_RIGHT, n) L^-1 of residual and Jacobian */
    double *turned;              /* (N_RIGHT, n) */
    double *squares;             /* (n) */
    double *shapes;              /* (n_shapes, n) L^-1 of them */
    double *columns;             /* (n_common + n_considered_common + 2, n) */
    double innovation[N_MEASURED];
    double log_mach_slope;       /* derivative of ln q_inf by M */
    double hessian[N_STATES * N_STATES], gradient[N_STATES], cost;
    double end[SEARCH_STARTS][N_STATES], end_deviance[SEARCH_STARTS]; /* where the iterations of the search ended */
    KeptEnds kept[KEPT_SEARCHES]; /* of the searches of this step: it may repeat them */
    size_t n_kept; /* 0 again with the next strain */
    size_t iterations; /* Gauss-Newton ones of this step */
    int has_before;              /* whether the iterations have taken a step: from this state, the whole of it this */
    double before[N_STATES], whole_step[N_STATES];
} FlightSolver;

/* Hand out the arrays, filled in but for those of the search. */
void flight_solver_arrays(const FlightMap *map, size_t n_gauges, int wide, FlightSolver *solver, Room *room);

/* Give the gauges errors of the covariance `own` (n_gauges, n_gauges), NULL for the map's, and of `added`. */
void flight_solver_add_noise(FlightSolver *solver, const double *own, const double *added);

/* S about the state of solver->response, in solver->factor, before it is decomposed; all gauges. */
void flight_strain_covariance(FlightSolver *solver);

/* The same of S with the considered errors, in solver->full.factor; solver->full.response has those with tables. */
void flight_full_covariance(FlightSolver *solver);

#endif
