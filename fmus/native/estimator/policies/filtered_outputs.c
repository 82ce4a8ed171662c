/* The outputs by the filter: which numbers are its channels, the noise in each, and where filtered values go.

   Channels of every map are five loads and five coefficients as they are put out; of a map with tables then the
   flight state (M, u, w, ln p_inf); then loads and coefficients in addition to the five. Each has the value and
   variance of the sample alone, and nu, the part of the variance that noise makes: responses of the solution to
   noise, squared (linear/linear_outputs.c, below). About the moment point of the settings a response of a moment is that
   about the map's point plus shift times that of its force.

   Filtered values replace loads and coefficients; air data follow from the filtered state, whose covariance is the
   sample's with rows and columns times the factors of its channels. Health, chi-square and residuals stay the single
   sample's. A sample that does not fit the map, or whose loads come from the linear map instead of the tables, is
   not averaged; without any strain a map with tables coasts. docs/explanation/filter.md, "Model" and "What
   does not fit". */

#include "policies.h"

#include <math.h>

static size_t n_loads(const Flight *flight) {
    return N_LOADS + flight->loads->map.n_loads;
}

/* Channels of load k and of its coefficient. */
static size_t load_channel(const Flight *flight, size_t k) {
    return k < N_LOADS ? LOAD_CHANNELS + k : STATE_CHANNELS + (flight->present ? (size_t)N_STATES : 0) + k - N_LOADS;
}

static size_t coefficient_channel(const Flight *flight, size_t k) {
    return k < N_LOADS ? COEFFICIENT_CHANNELS + k : load_channel(flight, k) + flight->loads->map.n_loads;
}

/* The row of load k in tables; about the moment point of the settings `shift` times that of its force, two rows before, is
   added. */
typedef struct {
    const Response *response;
    size_t row;
    double shift;
} LoadRow;

static LoadRow row_of(const Flight *flight, size_t k) {
    if (k >= N_LOADS) {
        return (LoadRow){&flight->other_loads.response, k - N_LOADS, 0.0};
    }
    return (LoadRow){&flight->solver.response, flight->solver.n_gauges + k, k >= N_FORCES ? moment_shift(flight->inputs) : 0.0};
}

/* Steps without any strain: the last filtered estimate stays, and its standard deviations grow with the time since
   then.

   The flight state x (4) may have moved by the spread t sqrt(rate_k^2 + seen_k^2) in each part, rate the standard
   deviations of rates that the map allows, seen the rates of the last windows. With the slopes J_L of the tables,
   the variance of a load and of its coefficient grows by

       sum over k of (J_Lk spread_k)^2,      sum over k of ((scale J_Lk - C d ln q/dx_k) spread_k)^2,

   slopes at the largest incidence within the spread, where they are largest: the estimate must not become certain
   because it happened to be at zero incidence. Once the state is no longer identified against the ranges of the map,
   nothing is known. docs/explanation/filter.md, "What does not fit". */

/* How far the flight state may have moved, in standard deviations of each part. */
static void coast_spread(const Filter *filter, double time, double spread[N_STATES]) {
    for (size_t k = 0; k < N_STATES; k++) {
        const double allowed = filter->map.rate[k], seen = filter->last_rate[STATE_CHANNELS + k];
        spread[k] = time * sqrt(allowed * allowed + seen * seen);
    }
}

/* The flight state whose slopes count: at the largest incidence of the spread, where they are the largest. */
static void set_slope_state(const Flight *flight, const double *state, const double *spread, double *outer) {
    static const double NONE[N_STATES] = {0.0};
    const double u = state[STATE_U], w = state[STATE_W], incidence = sqrt(u * u + w * w);
    const double reach = sqrt(spread[STATE_U] * spread[STATE_U] + spread[STATE_W] * spread[STATE_W]);
    const double limit = flight->map.incidence_limit, more = reach < limit ? reach : limit;
    memcpy(outer, state, N_STATES * sizeof *outer);
    outer[STATE_U] += incidence > 0.0 ? more * (u / incidence) : more;
    outer[STATE_W] += incidence > 0.0 ? more * (w / incidence) : 0.0;
    flight_limited(&flight->map, outer, NONE, outer);
}

static double square_of_spread(const double *slope, const double *spread) {
    double sum = 0.0;
    for (size_t k = 0; k < N_STATES; k++) {
        sum += (slope[k] * spread[k]) * (slope[k] * spread[k]);
    }
    return sum;
}

/* The two sums above, added to the variances of the last filtered sample. */
static void set_variances(const Filter *filter, size_t load, size_t coefficient, const double *slope, double scale,
                          const double *by_pressure, const double *spread, double variance[2]) {
    double of_coefficient[N_STATES];
    for (size_t k = 0; k < N_STATES; k++) {
        of_coefficient[k] = scale * slope[k] - filter->last_value[coefficient] * by_pressure[k];
    }
    variance[0] = filter->last_variance[load] + square_of_spread(slope, spread);
    variance[1] = filter->last_variance[coefficient] + square_of_spread(of_coefficient, spread);
}

/* The last loads, with variances by the slopes at the flight state of the responses. */
static void coast_loads(Flight *flight, const Filter *filter, const double *by_pressure, const double *spread) {
    for (size_t i = 0; i < n_loads(flight); i++) {
        const LoadOutput out = load_output(flight->output, flight->loads, i);
        const LoadRow at = row_of(flight, i);
        const size_t load = load_channel(flight, i), coefficient = coefficient_channel(flight, i);
        const double scale = 1.0 / (flight->real[AIR_DYNAMIC] * own_reference(flight->inputs, out.is_moment));
        double slope[N_STATES], variance[2];
        for (size_t k = 0; k < N_STATES; k++) {
            const double *jacobian = at.response->jacobian[k];
            slope[k] = jacobian[at.row] + (at.shift != 0.0 ? at.shift * jacobian[at.row - 2] : 0.0);
        }
        set_variances(filter, load, coefficient, slope, scale, by_pressure, spread, variance);
        *out.value = filter->last_value[load];
        *out.coefficient = filter->last_value[coefficient];
        *out.std = sqrt(variance[0]);
        *out.coefficient_std = sqrt(variance[1]);
    }
    flight->loads->outdated = 0;
}

/* Set all outputs by the last filtered sample, a time ago [s]: rates of the flight state are those that the map allows and
   those last seen. Where it is no longer identified, nothing is known. */
static void flight_coast(Flight *flight, Filter *filter, double time) {
    const double *state = filter->last_value + STATE_CHANNELS;
    Solution *solution = &flight->solver.solution;
    double spread[N_STATES], outer[N_STATES];
    coast_spread(filter, time, spread);
    memcpy(solution->state, state, sizeof solution->state);
    memset(solution->widened_covariance, 0, sizeof solution->widened_covariance);
    for (size_t k = 0; k < N_STATES; k++) {
        solution->widened_covariance[k * (N_STATES + 1)] =
            filter->last_variance[STATE_CHANNELS + k] + spread[k] * spread[k];
    }
    flight_air_data(&flight->map, flight->prior_std, solution, flight->real, flight->flag);
    memset(flight->flag + NAVIGATION_USED, 0, N_FLIGHT_FLAGS - NAVIGATION_USED);
    if (!flight->flag[TOTAL_INCIDENCE]) {
        flight_set_nothing_known(flight, NO_GAUGE);
        return;
    }
    const double by_pressure[N_STATES] = {2.0 / flight->real[AIR_MACH_NUMBER], 0.0, 0.0, 1.0};
    set_slope_state(flight, state, spread, outer);
    flight_response(&flight->solver.tables, flight->solver.wide, outer, &flight->solver.response);
    if (n_loads(flight) > N_LOADS) {
        flight_response(&flight->other_loads.tables, flight->solver.wide, outer, &flight->other_loads.response);
    }
    coast_loads(flight, filter, by_pressure, spread);
    flight->conditions = FILTER_HOLDS;
    filter->coasts = 1;
}

/* What noise that is independent from sample to sample adds to the errors of the nonlinear estimator: nu of the
   filter.

   An output o(d, z) of the solution has, to first order, the response do/dd (n) to strain and do/dz (3) to
   navigation. Its rows here are in standard deviations of the noise,

       rows = [ do/dd diag(nu_g)^(1/2),  do/dz diag(b sigma_m^2)^(1/2) ],     nu = rows rows',

   b (of_air) is the part of the variance of air data that is noise. The state responds by dx/dd = H^-1 J' S^-1 and
   dx/dz_m = H^-1 H_m' / sigma_m^2, where `right` holds L^-1 J. A load f = L(x) + K r has df/dd = (J_L - K J) dx/dd +
   K, df/dz = (J_L - K J) dx/dz; a coefficient scale df - C d ln q/dx dx, widened as q_inf is (flight_loads.c).
   docs/explanation/filter.md, "Model". */

/* Length of a row. Scratch are rows of the state, of d ln q, of a load, of its strain and of its coefficient; then L^-1 of
   strain of five vectors. */
#define N_NOISE_ROWS (N_STATES + 4 + N_LOADS)
static size_t flight_noise_row(size_t n_gauges) {
    return in_lanes(n_gauges) + LANES;
}

/* S^-1 of what L has whitened (L'^-1 of it), times sqrt(nu_g) of each gauge. */
static void turn_to_noise(const FlightSolver *solver, const double *gauge_noise, size_t count, double *whitened) {
    const size_t n = solver->n;
    solve_upper(solver->wide, n, solver->factor, count, whitened);
    for (size_t k = 0; k < count; k++) {
        for (size_t g = 0; g < n; g++) {
            whitened[k * n + g] *= g < solver->n_gauges ? sqrt(gauge_noise[g]) : 0.0;
        }
    }
}

/* out = factor' rows of the state, plus what strain adds directly (n); NULL for nothing. */
static void combine_rows(const FlightSolver *solver, const double *factor, const double *rows, const double *direct,
                         double *out) {
    const size_t row = flight_noise_row(solver->n_gauges);
    for (size_t g = 0; g < row; g++) {
        out[g] = direct != NULL && g < solver->n ? direct[g] : 0.0;
    }
    for (size_t k = 0; k < N_STATES; k++) {
        for (size_t g = 0; g < row; g++) {
            out[g] += factor[k] * rows[k * row + g];
        }
    }
}

/* Rows of the state: H^-1 J' S^-1 by gauges, H^-1 H_m' / sigma_m^2 sqrt(b) sigma_m by navigation. */
static void set_state_rows(const FlightSolver *solver, const double *gauge_noise, double of_air, double *rows,
                           double *scratch) {
    const size_t n = solver->n, row = flight_noise_row(solver->n_gauges);
    const double *errors = solver->solution.state_covariance;
    memcpy(scratch, solver->right + n, N_STATES * n * sizeof *scratch);
    turn_to_noise(solver, gauge_noise, N_STATES, scratch);
    memset(rows, 0, N_STATES * row * sizeof *rows);
    for (size_t k = 0; k < N_STATES; k++) {
        for (size_t j = 0; j < N_STATES; j++) {
            for (size_t g = 0; g < n; g++) {
                rows[k * row + g] += errors[k * N_STATES + j] * scratch[j * n + g];
            }
        }
    }
    for (size_t m = 0; m < N_NAVIGATION; m++) {
        const double size = sqrt(of_air * solver->sample.precision[m]);
        double read[N_STATES];
        flight_measurement_row(solver->log_mach_slope, m, read);
        for (size_t k = 0; k < N_STATES; k++) {
            for (size_t j = 0; j < N_STATES; j++) {
                rows[k * row + n + m] += errors[k * N_STATES + j] * read[j] * size;
            }
        }
    }
}

static double square_of(size_t count, const double *x) {
    double sum = 0.0;
    for (size_t k = 0; k < count; k++) {
        sum += x[k] * x[k];
    }
    return sum;
}

/* nu of load i and of its coefficient, from rows of the state and of d ln q behind them, and L^-1 of the covariance of loads
   with strain (n) as flight_turn has it; `scratch` takes three rows. */
static void set_load_noise(Filter *filter, const Flight *flight, const PressureErrors *pressure, size_t i, const double *turned,
                           const double *rows, double *scratch) {
    const FlightSolver *solver = &flight->solver;
    const size_t n = solver->n, row = flight_noise_row(solver->n_gauges);
    const LoadOutput out = load_output(flight->output, flight->loads, i);
    const LoadRow at = row_of(flight, i);
    const double scale = 1.0 / (pressure->dynamic * own_reference(flight->inputs, out.is_moment));
    double by_state[N_STATES], of_force[N_STATES], wider = sqrt(pressure->wider);
    double *strain = scratch, *of_load = strain + row, *of_coefficient = of_load + row;
    const double *of_pressure = rows + N_STATES * row;
    flight_corrected(solver, solver->right, at.response, at.row, turned, by_state);
    memcpy(strain, turned, n * sizeof *strain);
    if (at.shift != 0.0) {
        flight_corrected(solver, solver->right, at.response, at.row - 2, turned - 2 * n, of_force);
        add_times(N_STATES, at.shift, of_force, by_state);
        add_times(n, at.shift, turned - 2 * n, strain);
    }
    turn_to_noise(solver, filter->map.noise, 1, strain);
    combine_rows(solver, by_state, rows, strain, of_load);
    for (size_t g = 0; g < row; g++) {
        of_coefficient[g] = wider * (scale * of_load[g] - *out.coefficient * of_pressure[g]);
    }
    filter->noise[load_channel(flight, i)] = square_of(row, of_load);
    filter->noise[coefficient_channel(flight, i)] = square_of(row, of_coefficient);
}

/* nu of all channels of a map with tables. */
static void set_flight_noise(Filter *filter, const Flight *flight) {
    const FlightSolver *solver = &flight->solver;
    const size_t n = solver->n, row = flight_noise_row(solver->n_gauges);
    const PressureErrors pressure = flight_pressure_errors(solver);
    double *rows = filter->row, *of_pressure = rows + N_STATES * row, *scratch = of_pressure + row, *turned = scratch + 3 * row;
    set_state_rows(solver, filter->map.noise, filter->map.white_navigation, rows, turned);
    combine_rows(solver, pressure.by_state, rows, NULL, of_pressure);
    for (size_t k = 0; k < N_STATES; k++) {
        filter->noise[STATE_CHANNELS + k] = square_of(row, rows + k * row);
    }
    flight_turn(solver, flight->map.load_strain_covariance, N_LOADS, turned);
    for (size_t i = 0; i < n_loads(flight); i++) {
        const double *of_strain = i < N_LOADS ? turned + i * n : flight->other_loads.turned + (i - N_LOADS) * n;
        set_load_noise(filter, flight, &pressure, i, of_strain, rows, scratch);
    }
}

int filtered_outputs_create(MapFile *file, const Flight *flight, Filter *filter) {
    const Map *map = flight->inputs->map;
    const size_t of_flight = N_NOISE_ROWS * flight_noise_row(map->n_gauges), of_linear = 2 * linear_noise_row(map);
    const size_t channels = 2 * n_loads(flight) + (flight->present ? N_STATES : 0);
    return filter_create(file, flight->inputs, channels, flight->present ? of_flight : of_linear, filter);
}

static double square(double x) {
    return x * x;
}

static void set_loads(Filter *filter, Flight *flight) {
    if (n_loads(flight) > N_LOADS) {
        flight_other_loads_update(flight);
    }
    for (size_t k = 0; k < n_loads(flight); k++) {
        const size_t load = load_channel(flight, k), coefficient = coefficient_channel(flight, k);
        const LoadOutput out = load_output(flight->output, flight->loads, k);
        filter->value[load] = *out.value;
        filter->variance[load] = square(*out.std);
        filter->value[coefficient] = *out.coefficient;
        filter->variance[coefficient] = square(*out.coefficient_std);
    }
}

static void set_linear_noise(Filter *filter, const Flight *flight) {
    for (size_t k = 0; k < n_loads(flight); k++) {
        double noise[2];
        linear_noise(flight->linear, k, filter->map.noise, filter->map.white_navigation, filter->row, noise);
        filter->noise[load_channel(flight, k)] = noise[0];
        filter->noise[coefficient_channel(flight, k)] = noise[1];
    }
}

/* Whether the estimate of the sample alone is one, and strain fits the map. */
static int is_estimate(const Flight *flight) {
    const double *output = flight->output;
    if (flight->present) {
        return output[VALID_GAUGES] > 0.0 && flight->fits && !flight->flag[LINEAR_LOADS];
    }
    return (flight->linear->conditions & (NO_GAUGE | NOT_IDENTIFIED | PRESSURE_UNKNOWN)) == 0
        && output[CHI_SQUARE] <= output[CHI_SQUARE_LIMIT];
}

/* The estimate of the sample alone, and its noise, to the channels. */
static void set_sample(Filter *filter, Flight *flight) {
    set_loads(filter, flight);
    if (flight->present) {
        const Solution *solution = &flight->solver.solution;
        for (size_t k = 0; k < N_STATES; k++) {
            filter->value[STATE_CHANNELS + k] = solution->state[k];
            filter->variance[STATE_CHANNELS + k] = solution->widened_covariance[k * (N_STATES + 1)];
        }
        set_flight_noise(filter, flight);
    } else {
        set_linear_noise(filter, flight);
    }
}

static void write_flight(const Filter *filter, Flight *flight) {
    Solution filtered = flight->solver.solution;
    memcpy(filtered.state, filter->mean + STATE_CHANNELS, sizeof filtered.state);
    scale_covariance(N_STATES, filter->factor + STATE_CHANNELS, filtered.widened_covariance);
    flight_air_data(&flight->map, flight->prior_std, &filtered, flight->real, flight->flag);
}

static void write_filtered(const Filter *filter, Flight *flight) {
    for (size_t k = 0; k < n_loads(flight); k++) {
        const size_t load = load_channel(flight, k), coefficient = coefficient_channel(flight, k);
        const LoadOutput out = load_output(flight->output, flight->loads, k);
        *out.value = filter->mean[load];
        *out.std = sqrt(filter->left[load]);
        *out.coefficient = filter->mean[coefficient];
        *out.coefficient_std = sqrt(filter->left[coefficient]);
    }
    if (flight->present) {
        write_flight(filter, flight);
    }
}

void filtered_outputs(Filter *filter, Flight *flight, double time_constant) {
    if (is_estimate(flight)) {
        set_sample(filter, flight);
        if (filter_sample(filter, flight->inputs, time_constant) && filter->part_left < 1.0) {
            write_filtered(filter, flight);
        }
        return;
    }
    const double since = filter_no_sample(filter, flight->inputs);
    if (flight->present && flight->output[VALID_GAUGES] == 0.0 && since >= 0.0) {
        flight_coast(flight, filter, since);
    }
}
