/* The outputs by the filter: which numbers are its channels, the noise in each, and where filtered values go.

   Channels of every map are five loads and five coefficients as they are put out; of a map with tables then the
   flight state (M, u, w, ln p_inf); then loads and coefficients in addition to the five. Each has the value and
   variance of the sample alone, and nu, the part of the variance that noise makes: responses of the solution to
   noise, squared (linear/linear_outputs.c, below). At moment point and references of the settings a
   row of a moment is row_M + shift row_F, so that rows are combined before they are squared.

   Filtered values replace loads and coefficients; air data follow from the filtered state, whose covariance is the
   sample's with rows and columns times the factors of its channels. Health, chi-square and residuals stay the single
   sample's. A sample that does not fit the map, or whose loads come from the linear map instead of the tables, is
   not averaged; without any strain a map with tables coasts. docs/explanation/filter.md, "Model" and "What
   does not fit". */

#include "policies.h"

#include <math.h>

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

static void coast_loads(Flight *flight, const Filter *filter, const double *by_pressure, const double *scale,
                        const double *spread) {
    const Response *response = &flight->solver.response;
    const double shift = moment_shift(flight->inputs);
    for (size_t i = 0; i < N_LOADS; i++) {
        const size_t row = flight->solver.n_gauges + i;
        double slope[N_STATES], variance[2];
        for (size_t k = 0; k < N_STATES; k++) {
            slope[k] = response->jacobian[k][row] + (i >= 3 ? shift * response->jacobian[k][row - 2] : 0.0);
        }
        set_variances(filter, LOAD_CHANNELS + i, COEFFICIENT_CHANNELS + i, slope, scale[i], by_pressure, spread, variance);
        flight->output[LOADS + i] = filter->last_value[LOAD_CHANNELS + i];
        flight->output[COEFFICIENTS + i] = filter->last_value[COEFFICIENT_CHANNELS + i];
        flight->output[LOADS_STD + i] = sqrt(variance[0]);
        flight->output[COEFFICIENTS_STD + i] = sqrt(variance[1]);
    }
}

static void coast_other_loads(Flight *flight, const Filter *filter, const double *outer, const double *by_pressure,
                              const double *scale, const double *spread) {
    OtherLoads *out = flight->loads;
    FlightOtherLoads *tables = &flight->other_loads;
    const size_t m = out->map.n_loads, first = STATE_CHANNELS + N_STATES;
    if (m == 0) {
        return;
    }
    flight_response(&tables->tables, flight->solver.wide, outer, &tables->response);
    for (size_t j = 0; j < m; j++) {
        double slope[N_STATES], variance[2];
        for (size_t k = 0; k < N_STATES; k++) {
            slope[k] = tables->response.jacobian[k][j];
        }
        set_variances(filter, first + j, first + m + j, slope, scale[out->map.is_moment[j] > 0.0 ? 3 : 0], by_pressure,
                      spread, variance);
        out->value[OTHER_LOADS][j] = filter->last_value[first + j];
        out->value[OTHER_COEFFICIENTS][j] = filter->last_value[first + m + j];
        out->value[OTHER_LOADS_STD][j] = sqrt(variance[0]);
        out->value[OTHER_COEFFICIENTS_STD][j] = sqrt(variance[1]);
    }
    out->outdated = 0;
}

/* Set all outputs by the last filtered sample, a time ago [s]: rates of the flight state are those that the map allows and
   those last seen. Where it is no longer identified, nothing is known. */
static void flight_coast(Flight *flight, Filter *filter, double time) {
    const double *state = filter->last_value + STATE_CHANNELS, *scalar = flight->inputs->value + flight->solver.n_gauges;
    Solution *solution = &flight->solver.solution;
    double spread[N_STATES], outer[N_STATES], scale[N_LOADS];
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
    coefficient_scales(flight->real[AIR_DYNAMIC], scalar[REFERENCE_AREA], scalar[REFERENCE_LENGTH], scale);
    coast_loads(flight, filter, by_pressure, scale, spread);
    coast_other_loads(flight, filter, outer, by_pressure, scale, spread);
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
   Covariance of two outputs is the product of their rows, which the transfer of moments needs.
   docs/explanation/filter.md, "Model". */

/* Rows (N_NOISE_ROWS, n + LANES) are of the flight state, five loads, five coefficients at the references of the map. */
#define N_NOISE_ROWS (N_STATES + 2 * N_LOADS)
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

/* wider (scale df - C d ln q/dx dx), from the row of the load. */
static void set_coefficient_row(const FlightSolver *solver, const PressureErrors *pressure, double scale, double coefficient,
                                const double *rows, const double *of_load, double *out) {
    const size_t row = flight_noise_row(solver->n_gauges);
    const double wider = sqrt(pressure->wider);
    combine_rows(solver, pressure->by_state, rows, NULL, out);
    for (size_t g = 0; g < row; g++) {
        out[g] = wider * (scale * of_load[g] - coefficient * out[g]);
    }
}

/* Set them for gauges with these variances of noise (n_gauges), and the part of the variance of air data that is noise; of
   the last solution. rows take another (N_STATES + N_LOADS) of them as scratch. */
static void flight_noise_rows(const FlightSolver *solver, const double *gauge_noise, double of_air, double *rows) {
    const FlightMap *map = solver->map;
    const size_t n = solver->n, row = flight_noise_row(solver->n_gauges);
    const PressureErrors pressure = flight_pressure_errors(solver);
    double *loads = rows + N_STATES * row, *coefficients = loads + N_LOADS * row, *scratch = coefficients + N_LOADS * row;
    double by_state[N_LOADS][N_STATES];
    set_state_rows(solver, gauge_noise, of_air, rows, scratch);
    flight_turn(solver, map->load_strain_covariance, N_LOADS, scratch);
    for (size_t i = 0; i < N_LOADS; i++) {
        flight_corrected(solver, solver->right, &solver->response, solver->n_gauges + i, scratch + i * n, by_state[i]);
    }
    turn_to_noise(solver, gauge_noise, N_LOADS, scratch);
    for (size_t i = 0; i < N_LOADS; i++) {
        const double reference = i < 3 ? map->reference_area : map->reference_area * map->reference_length;
        combine_rows(solver, by_state[i], rows, scratch + i * n, loads + i * row);
        set_coefficient_row(solver, &pressure, 1.0 / (pressure.dynamic * reference), solver->solution.coefficients[i], rows,
                            loads + i * row, coefficients + i * row);
    }
}

static double square_of(size_t count, const double *x) {
    double sum = 0.0;
    for (size_t k = 0; k < count; k++) {
        sum += x[k] * x[k];
    }
    return sum;
}

/* The same of loads in addition to the five, one row at a time: only their variances are needed. */
static void flight_other_noise(FlightOtherLoads *other_loads, const FlightSolver *solver, const Inputs *inputs,
                        const OtherLoads *out, const double *gauge_noise, const double *rows, double *scratch,
                        double *of_loads, double *of_coefficients) {
    const FlightMap *map = solver->map;
    const size_t n = solver->n, row = flight_noise_row(solver->n_gauges), m = other_loads->map.tables.n_rows;
    const PressureErrors pressure = flight_pressure_errors(solver);
    double *of_load = scratch, *of_coefficient = scratch + row;
    for (size_t j = 0; j < m; j++) {
        const int is_moment = out->map.is_moment[j] > 0.0;
        const double reference = map->reference_area * (is_moment ? map->reference_length : 1.0);
        const double own =
            scalar_input(inputs, REFERENCE_AREA) * (is_moment ? scalar_input(inputs, REFERENCE_LENGTH) : 1.0);
        const double scale = 1.0 / (pressure.dynamic * reference), turn = reference / own;
        double by_state[N_STATES], *turned = other_loads->turned + j * n;
        flight_corrected(solver, solver->right, &other_loads->response, j, turned, by_state);
        turn_to_noise(solver, gauge_noise, 1, turned);
        combine_rows(solver, by_state, rows, turned, of_load);
        set_coefficient_row(solver, &pressure, scale, scale * out->value[OTHER_LOADS][j], rows, of_load, of_coefficient);
        of_loads[j] = square_of(row, of_load);
        of_coefficients[j] = turn * turn * square_of(row, of_coefficient);
    }
}

static size_t first_other(const Flight *flight) {
    return STATE_CHANNELS + (flight->present ? N_STATES : 0);
}

static size_t other_count(const Flight *flight) {
    return flight->loads->present ? flight->loads->map.n_loads : 0;
}

int filtered_outputs_create(MapFile *file, const Flight *flight, Filter *filter) {
    const Map *map = flight->inputs->map;
    const size_t of_flight = (N_NOISE_ROWS + N_STATES + N_LOADS + 2) * flight_noise_row(map->n_gauges);
    const size_t of_linear = N_LOADS * linear_noise_row(map), channels = first_other(flight) + 2 * other_count(flight);
    return filter_create(file, flight->inputs, channels, flight->present ? of_flight : of_linear, filter);
}

static double square(double x) {
    return x * x;
}

/* Outputs that are channels: from a channel on, values and their standard deviations. */
typedef struct {
    size_t channel, count;
    double *value, *std;
} ChannelRun;

enum { N_CHANNEL_RUNS = 4 };

static void list_runs(const Flight *flight, ChannelRun run[N_CHANNEL_RUNS]) {
    const size_t m = other_count(flight), first = first_other(flight);
    double *output = flight->output, *const *value = flight->loads->value;
    run[0] = (ChannelRun){LOAD_CHANNELS, N_LOADS, output + LOADS, output + LOADS_STD};
    run[1] = (ChannelRun){COEFFICIENT_CHANNELS, N_LOADS, output + COEFFICIENTS, output + COEFFICIENTS_STD};
    run[2] = (ChannelRun){first, m, value[OTHER_LOADS], value[OTHER_LOADS_STD]};
    run[3] = (ChannelRun){first + m, m, value[OTHER_COEFFICIENTS], value[OTHER_COEFFICIENTS_STD]};
}

static void set_loads(Filter *filter, Flight *flight) {
    ChannelRun run[N_CHANNEL_RUNS];
    list_runs(flight, run);
    if (other_count(flight) > 0) {
        flight_other_loads_update(flight);
    }
    for (size_t r = 0; r < N_CHANNEL_RUNS; r++) {
        for (size_t k = 0; k < run[r].count; k++) {
            filter->value[run[r].channel + k] = run[r].value[k];
            filter->variance[run[r].channel + k] = square(run[r].std[k]);
        }
    }
}

static void set_linear_noise(Filter *filter, const Flight *flight) {
    const size_t first = first_other(flight), m = other_count(flight);
    const double *gauge = filter->map.noise, of_pressure = filter->map.white_navigation;
    linear_noise(flight->linear, gauge, of_pressure, filter->row, filter->noise + LOAD_CHANNELS,
                 filter->noise + COEFFICIENT_CHANNELS);
    if (m > 0) {
        linear_other_noise(flight->linear, gauge, of_pressure, filter->row, filter->noise + first,
                           filter->noise + first + m);
    }
}

/* Sum of squares of own row + times other. */
static double square_of_rows(size_t count, double own, const double *row, double times, const double *other) {
    double sum = 0.0;
    for (size_t g = 0; g < count; g++) {
        sum += square(own * row[g] + times * other[g]);
    }
    return sum;
}

/* nu of all channels of a map with tables. */
static void set_flight_noise(Filter *filter, Flight *flight) {
    const FlightSolver *solver = &flight->solver;
    const FlightMap *map = &flight->map;
    const size_t row = flight_noise_row(solver->n_gauges), first = first_other(flight), m = other_count(flight);
    const double *gauge = filter->map.noise, *scalar = flight->inputs->value + solver->n_gauges;
    const double shift = moment_shift(flight->inputs);
    double *rows = filter->row, *loads = rows + N_STATES * row, *coefficients = loads + N_LOADS * row;
    flight_noise_rows(solver, gauge, filter->map.white_navigation, rows);
    for (size_t k = 0; k < N_STATES; k++) {
        filter->noise[STATE_CHANNELS + k] = square_of_rows(row, 1.0, rows + k * row, 0.0, rows);
    }
    for (size_t i = 0; i < N_LOADS; i++) {
        const size_t force = i < 3 ? i : i - 2;
        const double own_reference = scalar[REFERENCE_AREA] * (i < 3 ? 1.0 : scalar[REFERENCE_LENGTH]);
        const double scale = map->reference_area * (i < 3 ? 1.0 : map->reference_length) / own_reference;
        const double of_force = i < 3 ? 0.0 : shift * map->reference_area / own_reference;
        filter->noise[LOAD_CHANNELS + i] =
            square_of_rows(row, 1.0, loads + i * row, i < 3 ? 0.0 : shift, loads + force * row);
        filter->noise[COEFFICIENT_CHANNELS + i] =
            square_of_rows(row, scale, coefficients + i * row, of_force, coefficients + force * row);
    }
    if (m > 0) {
        flight_other_noise(&flight->other_loads, solver, flight->inputs, flight->loads, gauge, rows,
                           rows + (N_NOISE_ROWS + N_STATES + N_LOADS) * row, filter->noise + first,
                           filter->noise + first + m);
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
    ChannelRun run[N_CHANNEL_RUNS];
    list_runs(flight, run);
    for (size_t r = 0; r < N_CHANNEL_RUNS; r++) {
        for (size_t k = 0; k < run[r].count; k++) {
            run[r].value[k] = filter->mean[run[r].channel + k];
            run[r].std[k] = sqrt(filter->left[run[r].channel + k]);
        }
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
