/* The nonlinear solution: tables over the flight state, the problem about a state, its solution and what follows. */

#ifndef NONLINEAR_H
#define NONLINEAR_H

#include "../sample/sample.h"

/* Strain and loads over the flight state, as strainfmu/estimator/map/flight_tables.py has them. Rows are strains, then the five
   loads; or the other loads. */

/* What cells are made of, each when it is first read in a round: a first part and the others times a weight. */
typedef struct {
    size_t n_weights, n_cells;
    const double *part;   /* (1 + n_weights, n_cells, width) */
    double *weight;       /* (n_weights) */
    double *made;         /* (n_cells) the round that each is of */
    double round;         /* whole number, from 1 on; another one makes all of them again */
} CellParts;

typedef struct {
    const TableMap *map;
    const CellParts *parts; /* of the cells; NULL where they are all there */
    size_t harmonics;       /* n_harmonics in lanes */
    size_t width;           /* of the coefficients at a pair of knots */
    double *cells;          /* (n_mach + 2, n_incidence + 2, width) */
    double *cosine, *sine;  /* (n_terms, harmonics) */
    double *amplitude[3];   /* (width) scratch: value, derivatives by M and incidence */
    double *wind[6];        /* (harmonics) scratch: cos and sin of m phi_T, derivatives by u, by w */
} FlightTables;

/* Response at a flight state, of the same tables always. */
typedef struct {
    int known;                  /* whether there is one yet */
    double state[N_STATES];     /* that it belongs to */
    double pressure;            /* p_inf [Pa] */
    double *value;              /* (rows) */
    double *jacobian[N_STATES]; /* (rows) */
} Response;

/* Number of doubles of the coefficients at all pairs of knots. */
size_t flight_cell_doubles(const TableMap *map);

/* Hand out the arrays of tables, filled in, and of a response. */
void flight_tables_arrays(const TableMap *map, FlightTables *tables, Room *room);
void response_arrays(const TableMap *map, Response *response, Room *room);

/* The response at a state, kept where it is there already: a step starts where the one before ended. wide as for
   CHOSEN. */
void flight_response(const FlightTables *tables, int wide, const double *state, Response *response);

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
    KeptEnds kept[KEPT_SEARCHES]; /* of the searches of this step: it may repeat them */
    size_t n_kept;        /* 0 again with the next strain */
    const KeptEnds *ends; /* of the last search */
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

/* Loads and coefficients of the solution, from its state and the problem about it; their covariances, and the state's, by
   the full model. */
void flight_set_loads(FlightSolver *solver);

/* q_inf of the solution [Pa], the derivative of its logarithm by the state, the logarithm less the full model's, and the
   variance that covers its error over the variance of the logarithm. */
typedef struct {
    double dynamic, by_state[N_STATES], apart, wider;
} PressureErrors;

PressureErrors flight_pressure_errors(const FlightSolver *solver);

/* L^-1 of `count` covariances with strain (count, n_gauges), per p_inf^2, in turned (count, n). */
void flight_turn(const FlightSolver *solver, const double *strain_covariance, size_t count, double *turned);

/* A row of a response at the solution, corrected by the weighted residual in `right`, and its derivatives by the state;
   `turned` (n) is that row of flight_turn. */
double flight_corrected(const FlightSolver *solver, const double *right, const Response *response, size_t row,
                        const double *turned, double *by_state);

/* Angles, Mach number and pressures of a flight state: strainfmu/estimator/reference/air.py. */

#define N_AIR_DATA 7

enum { ANGLE_OF_ATTACK, SIDESLIP_ANGLE, TOTAL_INCIDENCE, WIND_ROLL_ANGLE, AIR_MACH_NUMBER, AIR_PRESSURE, AIR_DYNAMIC };

/* Air data of a solution, (2, N_AIR_DATA) with their sigmas, and whether each is identified: better known than by the
   ranges of the map, whose standard deviations are prior_std (N_STATES). */
void flight_air_data(const FlightMap *map, const double *prior_std, const Solution *solution, double *value,
                     unsigned char *is_identified);

/* Loads in addition to the five over the flight state, part "flight_loads" of resources/map.bin. */

typedef struct {
    TableMap tables;                 /* a row per load, on the knots of the tables of strain; no rows in maps without */
    MAP_MEMBERS(FLIGHT_LOADS)
} FlightOtherLoadsMap;

typedef struct {
    FlightOtherLoadsMap map;
    FlightTables tables;
    Response response;
    double *turned; /* (n_loads, n) L^-1 of strain_covariance, n_gauges in lanes */
    double *full_turned; /* (n_loads, n) the same of the full model */
    double *others; /* (MOST_OTHERS, n_loads) of the tables at other solutions */
} FlightOtherLoads;

/* Read the part of n_loads loads in addition to the tables of `flight`. 1; 0 with a text. */
int flight_other_loads_parse(MapFile *file, const FlightMap *flight, size_t n_loads, FlightOtherLoadsMap *map);

/* Hand out the arrays, filled in. */
void flight_other_loads_arrays(FlightOtherLoads *other_loads, size_t n_gauges, Room *room);

/* Set out->value for the solution, at the references of the settings. */
void flight_other_loads_at(FlightOtherLoads *other_loads, const FlightSolver *solver, const Inputs *inputs, OtherLoads *out);

/* All of them are not known. */
void other_loads_unknown(OtherLoads *out);

/* Parameters of the flow that are known with a standard deviation: tables and errors about what is known of them. */

/* Part "parameter_tables" of map.bin: tables and errors that follow known flow parameters, as sums over powers of
   each parameter.

   Powers are listed by ascending parameter, exponents 1 to 3. Tables of a power are sums over n_basis tables of
   incidence and harmonic, weighted by Mach knot and row. Products of errors, per p_inf^2, come in the order: of what
   no parameter makes; of each pair of powers a <= b of one parameter; of the spread of each parameter. Each product
   is a run of

       n n + 5 n + 25 + m n + m      strain; loads with strain; loads; m other loads with strain; variances of these

   numbers. Arrays point into the bytes of the file. */
typedef struct {
    size_t n_rows, n_other; /* of strains, loads and other loads; of these the last */
    MAP_MEMBERS(PARAMETER_TABLES)
    MAP_MEMBERS(PRODUCTS)
} KnownMap;

/* Tables, and products of their errors per p_inf^2. */
typedef struct {
    FlightTables tables, other_loads;
    double *scaled_covariance;       /* (n, n) in lanes */
    const double *load_strain_covariance, *load_covariance;
    const double *other_strain_covariance, *other_variance;
} Errors;

/* Tables of two channels to a row, the factors of cos m phi_T and of sin m phi_T, made of parts. */
typedef struct {
    TableMap map;
    CellParts parts; /* of the mean, then of a unit of each power */
} MadeTables;

typedef struct {
    int present;  /* whether the map has such tables; if not, nothing else is set */
    int in_use;   /* whether the solver's tables are `own`; the mean's else */
    KnownMap map;
    FlightMap *flight;      /* whose tables and errors they replace, with the solver's */
    FlightSolver *solver;
    FlightOtherLoads *others;  /* and of loads in addition to the five */
    MadeTables tables, other_loads;
    Errors mean, own;
    double *value, *std;            /* (n_parameters) that `own` is for, NaN of what is not known, and of all at first */
    double *weight, *shift, *along; /* (n_parameters), (n_powers), (n_powers) scratch */
    double *products;               /* (known_product_size) of `own` */
} Known;

/* Read the part in addition to the tables of strain. 1; 0 with a text. */
int known_map_parse(MapFile *file, const FlightMap *flight, size_t n_gauges, size_t n_other, KnownMap *map);

/* Lay out tables about the mean's, with other loads or without; hand out the arrays, filled in, after the tables of solver
   and other loads. */
void known_lay_out(const TableMap *mean, const TableMap *others, Known *known);
void known_arrays(FlightMap *flight, FlightSolver *solver, FlightOtherLoads *others, Known *known, Room *room);

/* Set the solver's tables to the ones about what the inputs know, or to the mean's where they know nothing. */
void known_follow(Known *known, const Inputs *inputs);

/* Set them to the mean's. */
void known_forget(Known *known);

/* What is known of a sample: strain of the gauges in use, navigation, the ranges of the map. */

/* Take the gauges in use and their strain, at the reference temperature; their number. */
size_t flight_set_strain(FlightSolver *solver, const Inputs *inputs);

/* Navigation of the inputs, each with a standard deviation; NaN where not known. */
typedef struct {
    double value[N_NAVIGATION], std[N_NAVIGATION];
    int is_computed;    /* whether q_inf was computed from the others: nothing confirms them then */
    double of_loads[2]; /* q_inf and its sigma for loads of the linear map, also where it is computed and no value */
} Navigation;

void navigation_of(const FlightMap *map, const Inputs *inputs, Navigation *navigation);

/* What navigation, of these values and standard deviations, and the ranges of the map say of the flight state. */
void flight_set_measurement(FlightSolver *solver, const double *navigation, const double *navigation_std);

/* The flight state that fits strain and navigation, and loads, residuals and covariances that follow from it. */

/* Solve for solver->sample by a fixed number of iterations from a state. Then the solution is in solver->solution. */
void flight_solve_warm(FlightSolver *solver, const double *state);

/* The solution that iterations have ended with before, at solver->state with S at solver->factor_state. */
void flight_solve_again(FlightSolver *solver, const double *weighted_at, const double *state);

/* What it takes to have a solution again: its state and S's, what counts of navigation, residuals of it, and widening. */
typedef struct {
    double state[N_STATES], weighted_at[N_STATES];
    double precision[N_NAVIGATION], residual[N_NAVIGATION], widening[N_WIDENING];
} KeptSolution;

KeptSolution flight_keep(const FlightSolver *solver);

/* The same but for its widening. */
void flight_take_again(FlightSolver *solver, const KeptSolution *kept);

/* The parts of it: S renewed half-way, and what shows the best end of a search; the solution from a state; the problem about
   a state weighted by the last S, and by S there; -2 ln likelihood of the problem, less a constant. */
double flight_iterate_start(FlightSolver *solver, double *state);
void flight_solve_from(FlightSolver *solver, const double *state);
void flight_linearise_at(FlightSolver *solver, const double *state);
void flight_linearise_anew(FlightSolver *solver, const double *state);
double flight_deviance(const FlightSolver *solver);

/* The full model at the state of the problem, of which the first n_free elements are free. */
void flight_weigh_full(FlightSolver *solver, size_t n_free);

/* Its standardised residuals of the gauges, which settling leaves as they were. */
void flight_set_gauge_residuals(FlightSolver *solver);

/* Row of the measurement's Jacobian, of a derivative of ln q_inf by the Mach number. */
void flight_measurement_row(double log_mach_slope, size_t which, double *row);

/* A step from a state, not too long, and inside the reach of the tables. */
void flight_limited(const FlightMap *map, const double *from, const double *step, double *state);

/* Solve for solver->sample from a search of the tables. Then the solution is in solver->solution. */
void flight_solve_cold(FlightSolver *solver);

/* Where the search ends, in solver->ends, and the best of them. A step searches at most KEPT_SEARCHES times, once for the
   same navigation: after that the last ends stay. Whether they are for the navigation at hand. */
size_t flight_search_ends(FlightSolver *solver);
int flight_search_kept(FlightSolver *solver);

/* The best minima of the search's states, over incidence and roll angle, that are not near a state; their number. */
size_t flight_search_minima(FlightSolver *solver, const double *state, double minimum[MOST_MINIMA][N_STATES]);

/* Fill in the states of the search, or the weights of the gauges in it alone. */
void flight_search_prepare(FlightSolver *solver);
void flight_search_weigh(FlightSolver *solver);

#endif
