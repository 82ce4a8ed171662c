/* The flight state that fits strain and navigation, and loads, residuals and covariances that follow from it.

   The equations are those of strainfmu/estimator/reference/nonlinear.py. */

#ifndef FLIGHT_SOLVE_H
#define FLIGHT_SOLVE_H

#include "../map/map_resource.h"
#include "../tables/flight_tables.h"

#define MIN_MACH 0.1 /* below which ln M goes on as a constant */
#define N_RIGHT (1 + N_STATES) /* residual, then the columns of its Jacobian */

/* What is known of a sample. */
typedef struct {
    double *strain;              /* (n) [m/m], 0 of gauges that are not in use */
    unsigned char *used;         /* (n_gauges) */
    double value[N_MEASURED];    /* of navigation and priors */
    double precision[N_MEASURED]; /* 0 where not known */
} Sample;

/* States of the search, in the order of starts.py: incidences, of each the best is a start; Mach numbers; roll angles. */
#define SEARCH_STARTS 6
#define SEARCH_MACHS 3
#define SEARCH_ROLLS 16
#define SEARCH_STATES (SEARCH_MACHS * SEARCH_ROLLS) /* at each incidence */

#define N_WIDENING (N_STATES + 2 * N_LOADS) /* flight state, loads, coefficients */

/* Estimates of a sample, about the map's moment point and references. */
typedef struct {
    double state[N_STATES], state_covariance[N_STATES * N_STATES]; /* that of the problem about the state */
    double loads[N_LOADS], load_covariance[N_LOADS * N_LOADS];
    double coefficients[N_LOADS], coefficient_covariance[N_LOADS * N_LOADS];
    double chi_square;
    double rest_square; /* square of what another iteration would move the state by, in its deviations */
    double *standardised_residual; /* (n) */
    double navigation_residual[N_NAVIGATION];
    double widening[N_WIDENING];                       /* factors on deviations, for what else fits; 0 for none, */
    double widened_covariance[N_STATES * N_STATES];    /* of the state with them; those of the loads have them */
    double shape_square; /* chi-square of the shapes of pressure off the tables in the residual */
} Solution;

/* Where a search ended, of what navigation told with these precisions. */
typedef struct {
    double precision[N_NAVIGATION], end[SEARCH_STARTS][N_STATES], deviance[SEARCH_STARTS];
} KeptEnds;

#define KEPT_SEARCHES 2 /* with all of navigation, and without what is inconsistent */

/* Arrays are by gauge, `n` of them: n_gauges in lanes. */
typedef struct {
    const FlightMap *map;
    size_t n_gauges, n;
    int wide;
    FlightTables tables;
    double *gauge_covariance, *scaled_covariance; /* (n, n) */
    double *search_strain;                        /* (SEARCH_STARTS, SEARCH_STATES, n) per p_inf [1/Pa] */
    double search_mach[SEARCH_MACHS], search_crossflow[SEARCH_STARTS][2];
    double search_cosine[SEARCH_ROLLS], search_sine[SEARCH_ROLLS];
    double *search_weight;                        /* (n) 1 over the deviation of each gauge */
    Sample sample;
    Solution solution;
    /* Scratch: the problem about a state. */
    double state[N_STATES];
    Response response;
    double *factor;              /* (n, n) L */
    double factor_pressure;      /* p_inf that it belongs to [Pa] */
    double *inverse;             /* (n, n) L^-1 */
    double *right;               /* (N_RIGHT, n) L^-1 of residual and Jacobian */
    double *turned;              /* (N_RIGHT, n) */
    double *squares;             /* (n) */
    double *shapes;              /* (n_shapes, n) L^-1 of them */
    double *columns;             /* (n_common + 1, n) */
    double innovation[N_MEASURED];
    double log_mach_slope;       /* derivative of ln q_inf by M */
    double hessian[N_STATES * N_STATES], gradient[N_STATES], cost;
    double end[SEARCH_STARTS][N_STATES], end_deviance[SEARCH_STARTS]; /* where the iterations of the search ended */
    KeptEnds kept[KEPT_SEARCHES]; /* of the searches of this step: it may repeat them */
    size_t n_kept; /* 0 again with the next strain */
    int has_before;              /* whether the iterations have taken a step: from this state, the whole of it this */
    double before[N_STATES], whole_step[N_STATES];
} FlightSolver;

/* Number of doubles that its arrays take, and handing them out, filled in; *bytes gives n_gauges flags. */
size_t flight_solver_doubles(const FlightMap *map, size_t n_gauges);
void flight_solver_arrays(const FlightMap *map, size_t n_gauges, int wide, FlightSolver *solver, double **doubles,
                          unsigned char **bytes);

/* Let the gauges have errors of the covariance `own` (n_gauges, n_gauges), NULL for that of the map, and of `added`. */
void flight_solver_add_noise(FlightSolver *solver, const double *own, const double *added);

/* Solve for solver->sample: from a search of the tables, or by a fixed number of iterations from a state. Then the
   solution is in solver->solution. */
void flight_solve_cold(FlightSolver *solver);
void flight_solve_warm(FlightSolver *solver, const double *state);

/* The parts of it: where the search ends, in solver->end, and the best of them; the solution from there; the problem about
   a state weighted by S there; -2 ln likelihood of the problem, less a constant; the solution at its state. */
size_t flight_search_ends(FlightSolver *solver);
double flight_iterate_start(FlightSolver *solver, double *state); /* S renewed half-way; what tells the best end */
void flight_solve_from(FlightSolver *solver, const double *state);
void flight_linearise_anew(FlightSolver *solver, const double *state);
double flight_deviance(const FlightSolver *solver);
void flight_settle(FlightSolver *solver);

/* Loads and coefficients of the solution, from its state and the problem about it. */
void flight_set_loads(FlightSolver *solver);

/* q_inf of the solution [Pa], the derivative of its logarithm by the state, and the variance that covers its error over
   that of the logarithm. */
typedef struct {
    double dynamic, by_state[N_STATES], wider;
} PressureErrors;

PressureErrors flight_pressure_errors(const FlightSolver *solver);

/* L^-1 of `count` covariances with strain (count, n_gauges), per p_inf^2, in turned (count, n). */
void flight_turn(const FlightSolver *solver, const double *strain_covariance, size_t count, double *turned);

/* A row of a response at the solution, corrected by the residual of strain, and its derivatives by the state; `turned`
   (n) is that row of flight_turn. */
double flight_corrected(const FlightSolver *solver, const Response *response, size_t row, const double *turned,
                        double *by_state);

/* The relative deviation of a lognormal value three times which reach as far as three of its logarithm's. */
double lognormal_deviation(double of_log);

/* x' M x of a symmetric matrix, and x' M y. */
double quadratic(size_t order, const double *x, const double *matrix, const double *y);

/* The response, and what the measurement reads beside its values, at a state. For the filter, as the next two. */
void flight_evaluate(FlightSolver *solver, const double *state);

/* Row of the measurement's Jacobian, of a derivative of ln q_inf by the Mach number; and that derivative. */
void flight_measurement_row(double log_mach_slope, size_t which, double *row);
double flight_log_mach_slope(double mach);

/* A step from a state, not too long, and inside the reach of the tables. */
void flight_limited(const FlightMap *map, const double *from, const double *step, double *state);

/* Columns of the errors that all gauges have in common, in solver->columns, and variances of each gauge in own (n). */
void flight_proportional_errors(FlightSolver *solver, double *own);

/* S about the state of solver->response, in solver->factor, before it is decomposed; all gauges. For flight_search.c. */
void flight_strain_covariance(FlightSolver *solver);

/* Fill in the states of the search, or the weights of the gauges in it alone; write the best state at an incidence, by
   its index. */
void flight_search_prepare(FlightSolver *solver);
void flight_search_weigh(FlightSolver *solver);
void flight_search_start(FlightSolver *solver, size_t start, double *state);

#endif
