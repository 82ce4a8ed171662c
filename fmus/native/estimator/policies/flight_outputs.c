/* What a solution says: loads and coefficients at the settings, the tests of strain and ranges, conditions of health.

   Loads go to the moment point of the settings by rows t of a transfer, t = e_i for forces and e_i + shift e_(i-2)
   for moments, so that sigma^2 = t cov t'; coefficients take references of the map over references of the settings
   into t. The tests, each with a threshold that the build has set (docs/explanation/alarm_levels.md):

       chi-square       <= alarm_scale chi_square_scale chi2(freedom),  freedom = gauges + air data in use
       shape_square     <= alarm_scale shape_limit,                     discrepancy modes
       largest |z|      <= outlier_threshold sqrt(outlier_scale alarm_scale)
       range score      the largest distance of M, (u, w), ln p_inf from their ranges in standard deviations, 0 inside
       measured angles  sum of (v - x)^2 / (1/p + var x) <= chi2(number of angles) alarm_scale

   docs/explanation/nonlinear_estimator.md, "What comes out". */

#include "policies.h"

#include <math.h>

/* Air data that fit neither strain nor each other: which one is dropped, and which are doubted.

   z_k (3) are standardised residuals of M, ln p_inf, ln q_inf against strain and the others (flight_solve.c). The
   one of largest |z_k| / limit_k, where that is above 1, is dropped: its precision becomes 0, and the sample is
   solved again. Which of them is wrong is not certain where |z| of the dropped one is no alarm yet, or where another
   one explains nearly as much, z_dropped^2 - z_k^2 < DISCERNED. Then the others count with standard deviations
   |z_dropped| + 1 times as large, that is precision / (|z| + 1)^2, so that three standard deviations of the loads
   include either case; the 1 is the noise in z.

   A static pressure from which q_inf was computed is confirmed by nothing. From |z| > UNLIKELY_PRESSURE on it counts
   with a standard deviation |z| + 1 times as large. docs/explanation/nonlinear_estimator.md, "What comes out";
   without and doubted in strainfmu/estimator/reference/air.py. */

/* Difference of two sums of squares from which the quantity that leaves the larger one is not the wrong one. */
#define DISCERNED 16.0

/* Standardised residual from which a static pressure that nothing confirms is doubted. */
#define UNLIKELY_PRESSURE 1.5

/* Whether another quantity may be the wrong one, or none, where one is dropped; of their residuals. */
static int navigation_may_be_wrong(const Flight *flight, double dropped, double other) {
    return fabs(dropped) <= flight->map.navigation_alarm || dropped * dropped - other * other < DISCERNED;
}

/* Doubt a static pressure that no other measurement confirms and strain makes unlikely; whether it is. */
static int doubt_unconfirmed(Flight *flight) {
    const double size = fabs(flight->solver.solution.navigation_residual[1]), factor = size + 1.0;
    if (!flight->navigation.is_computed || !(size > UNLIKELY_PRESSURE)) {
        return 0;
    }
    flight->solver.sample.precision[1] /= factor * factor;
    return 1;
}

int flight_drop_inconsistent(Flight *flight) {
    const double *residual = flight->solver.solution.navigation_residual;
    size_t worst = 0;
    double largest = -1.0;
    for (size_t k = 0; k < N_NAVIGATION; k++) {
        const double excess = fabs(residual[k]) / flight->map.navigation_limit[k];
        if (excess > largest) {
            largest = excess;
            worst = k;
        }
    }
    double *precision = flight->solver.sample.precision;
    if (!(largest > 1.0)) {
        return doubt_unconfirmed(flight);
    }
    for (size_t k = 0; k < N_NAVIGATION; k++) {
        const double widening =
            navigation_may_be_wrong(flight, residual[worst], residual[k]) ? fabs(residual[worst]) + 1.0 : 1.0;
        precision[k] = k == worst ? 0.0 : precision[k] / (widening * widening);
    }
    return 1;
}

/* Whether a value that is given is not used, other than one whose residual is small enough to be a correct one. */
int flight_navigation_alarms(const Flight *flight) {
    int alarms = 0;
    for (size_t k = 0; k < N_NAVIGATION; k++) {
        const double size = fabs(flight->solver.solution.navigation_residual[k]);
        const int may_be_correct = size > 0.0 && size <= flight->map.navigation_alarm;
        alarms |= !isnan(flight->navigation.value[k]) && !(flight->solver.sample.precision[k] > 0.0) && !may_be_correct;
    }
    return alarms;
}

static size_t flight_navigation_used(const Flight *flight) {
    size_t count = 0;
    for (size_t k = 0; k < N_NAVIGATION; k++) {
        count += flight->solver.sample.precision[k] > 0.0;
    }
    return count;
}

#define LARGEST_REST 1.0 /* standard deviations that the next iteration may move the state by */

void flight_transfers(const Flight *flight, double of_loads[N_LOADS][N_LOADS], double of_coefficients[N_LOADS][N_LOADS]) {
    static const double ONES[N_LOADS] = {1.0, 1.0, 1.0, 1.0, 1.0};
    moment_transfer(flight->inputs, ONES, of_loads);
    for (size_t i = 0; i < N_LOADS; i++) {
        const double own = own_reference(flight->inputs, i >= N_FORCES);
        for (size_t j = 0; j < N_LOADS; j++) {
            of_coefficients[i][j] = of_loads[i][j] * map_reference(&flight->map, j >= N_FORCES) / own;
        }
    }
}

static void put(double transfer[N_LOADS][N_LOADS], const double *value, const double *covariance, double *out, double *std) {
    small_times(N_LOADS, transfer[0], value, out);
    for (size_t i = 0; i < N_LOADS; i++) {
        std[i] = sqrt(quadratic(N_LOADS, transfer[i], covariance, transfer[i]));
    }
}

/* Loads and coefficients at the references of the settings. */
static void set_loads(Flight *flight) {
    const Solution *solution = &flight->solver.solution;
    double of_loads[N_LOADS][N_LOADS], of_coefficients[N_LOADS][N_LOADS], *output = flight->output;
    flight_transfers(flight, of_loads, of_coefficients);
    put(of_loads, solution->loads, solution->load_covariance, output + LOADS, output + LOADS_STD);
    put(of_coefficients, solution->coefficients, solution->coefficient_covariance, output + COEFFICIENTS,
        output + COEFFICIENTS_STD);
}

/* Standard deviations by which u and w leave their ranges: incidence at every roll angle alike, or each range of its
   own. */
static double crossflow_excess(const FlightMap *map, const double *state, const double *std) {
    const double slack = 1.0 + map->range_tolerance;
    if (map->has_crossflow_range == 0.0) {
        const double incidence = sqrt(state[STATE_U] * state[STATE_U] + state[STATE_W] * state[STATE_W]);
        return (incidence - slack * map->incidence_limit) / larger(std[STATE_U], std[STATE_W]);
    }
    double excess[2];
    for (size_t k = 0; k < 2; k++) {
        const double off = fabs(state[STATE_U + k] - map->crossflow_middle[k]);
        excess[k] = (off - slack * map->crossflow_half[k]) / std[STATE_U + k];
    }
    return larger(excess[0], excess[1]);
}

/* The largest of the distances in M, (u, w) and ln p_inf; 0 inside. */
static double range_score(const Flight *flight) {
    const FlightMap *map = &flight->map;
    const Solution *solution = &flight->solver.solution;
    const double *state = solution->state, tolerance = map->range_tolerance;
    double std[N_STATES];
    for (size_t k = 0; k < N_STATES; k++) {
        std[k] = sqrt(solution->widened_covariance[k * N_STATES + k]);
    }
    const double mach = larger(map->mach_range[0] * (1.0 - tolerance) - state[STATE_MACH],
                               state[STATE_MACH] - map->mach_range[1] * (1.0 + tolerance));
    const double pressure = larger(map->log_pressure_range[0] - state[STATE_PRESSURE],
                                   state[STATE_PRESSURE] - map->log_pressure_range[1]);
    const double score = larger(mach / std[STATE_MACH], crossflow_excess(map, state, std));
    return larger(larger(score, pressure / std[STATE_PRESSURE]), 0.0);
}

/* Whether Mach number or p_inf of navigation, if used, leaves the ranges of the map. */
static int navigation_outside(const Flight *flight) {
    const FlightMap *map = &flight->map;
    const double *const range[2] = {map->mach_range, map->pressure_range};
    int outside = 0;
    for (size_t k = 0; k < 2; k++) {
        const double value = flight->navigation.value[k], slack = map->outside_score * flight->navigation.std[k];
        const int beyond = value < (1.0 - map->range_tolerance) * range[k][0] - slack
                        || value > (1.0 + map->range_tolerance) * range[k][1] + slack;
        outside |= beyond && flight->solver.sample.precision[k] > 0.0;
    }
    return outside;
}

static double chi_square_limit(const Flight *flight, size_t freedom) {
    const FlightMap *map = &flight->map;
    return scalar_input(flight->inputs, ALARM_SCALE) * map->chi_square_scale * map->chi_square_limit[freedom];
}

int flight_solution_fits(const Flight *flight, size_t used) {
    const Solution *solution = &flight->solver.solution;
    return solution->chi_square <= chi_square_limit(flight, used + flight_navigation_used(flight))
        && solution->shape_square <= flight->map.shape_limit * scalar_input(flight->inputs, ALARM_SCALE);
}

/* Whether the measured angles are others than the solution's. */
static int angles_contradict(const Flight *flight) {
    const MeasuredAngles *angles = &flight->solver.angles;
    const Solution *solution = &flight->solver.solution;
    double square = 0.0;
    for (size_t k = 0; k < 2; k++) {
        if (angles->precision[k] > 0.0) {
            const double off = angles->value[k] - solution->state[STATE_U + k];
            const double variance = solution->widened_covariance[(STATE_U + k) * (N_STATES + 1)];
            square += off * off / (1.0 / angles->precision[k] + variance);
        }
    }
    return square > scalar_input(flight->inputs, ALARM_SCALE) * flight->map.chi_square_limit[angles->count];
}

/* The gauge whose leave-one-out residual is largest, from 0; *size is its |z|. */
static size_t worst_gauge(const Flight *flight, double *size) {
    const double *z = flight->solver.solution.standardised_residual;
    size_t worst = 0;
    *size = 0.0;
    for (size_t g = 0; g < flight->solver.n_gauges; g++) {
        if (fabs(z[g]) > *size) {
            *size = fabs(z[g]);
            worst = g;
        }
    }
    return worst;
}

/* Bits of sample.h, from the outputs of the tests. */
static int conditions_of(const Flight *flight, size_t used) {
    const double *output = flight->output;
    const int outside = output[ENVELOPE_SCORE] > flight->map.outside_score || navigation_outside(flight)
                     || parameter_beyond(flight->inputs) != SIZE_MAX;
    return (outside ? FLOW_OUTSIDE : 0) | (flight->fits ? 0 : STRAIN_MISFIT)
         | (angles_contradict(flight) ? ANGLES_CONTRADICT : 0) | (output[SUSPECTS] > 0.0 ? GAUGE_MISFIT : 0)
         | (used < flight->solver.n_gauges ? GAUGES_LOST : 0) | (flight_navigation_alarms(flight) ? AIR_DATA_LOST : 0)
         | (flight->solver.solution.rest_square > LARGEST_REST * LARGEST_REST ? STATE_MOVES : 0);
}

/* Set the outputs of the tests, and what follows from them; whether strain and navigation fit the tables. */
static int judge(Flight *flight, size_t used) {
    const FlightMap *map = &flight->map;
    double *output = flight->output, largest;
    const size_t worst = worst_gauge(flight, &largest), freedom = used + flight_navigation_used(flight);
    const double alarm_scale = scalar_input(flight->inputs, ALARM_SCALE);
    const int suspect = largest > map->outlier_threshold * sqrt(map->outlier_scale * alarm_scale);
    output[CHI_SQUARE] = flight->solver.solution.chi_square;
    output[CHI_SQUARE_LIMIT] = chi_square_limit(flight, freedom);
    output[SUSPECT_GAUGE] = suspect ? (double)(worst + 1) : 0.0;
    output[SUSPECTS] = suspect ? 1.0 : 0.0;
    output[ENVELOPE_SCORE] = range_score(flight);
    flight->degrees_of_freedom = (double)freedom;
    flight->fits = flight_solution_fits(flight, used);
    flight->conditions = conditions_of(flight, used);
    return flight->fits;
}

int flight_conclude(Flight *flight, size_t used) {
    set_loads(flight);
    flight_air_data(&flight->map, flight->prior_std, &flight->solver.solution, flight->real, flight->flag);
    flight->flag[LINEAR_LOADS] = 0;
    for (size_t k = 0; k < N_NAVIGATION; k++) {
        flight->flag[NAVIGATION_USED + k] = flight->solver.sample.precision[k] > 0.0;
    }
    return judge(flight, used);
}

void flight_set_nothing_known(Flight *flight, int condition) {
    set_unknown(flight->output, chi_square_limit(flight, flight->solver.n_gauges));
    flight->output[SUSPECT_GAUGE] = flight->output[SUSPECTS] = 0.0;
    flight->conditions = condition;
    for (size_t k = 0; k < N_FLIGHT_REALS; k++) {
        flight->real[k] = NAN;
    }
    memset(flight->flag, 0, sizeof flight->flag);
    flight->next = flight->base;
}
