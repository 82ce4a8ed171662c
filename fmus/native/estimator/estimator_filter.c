#include "estimator_filter.h"

#include <math.h>
#include <string.h>

#include "linear/linear_noise.h"
#include "nonlinear/flight_noise.h"
#include "policies/coast.h"

static size_t first_other(const Estimator *e) {
    return STATE_CHANNELS + (e->flight.present ? N_STATES : 0);
}

static size_t other_count(const Estimator *e) {
    return e->other_loads.present ? e->other_loads.map.n_loads : 0;
}

int estimator_filter_create(Estimator *e, MapFile *file) {
    const size_t n = e->map.n_gauges;
    const size_t of_flight = (N_NOISE_ROWS + N_STATES + N_LOADS + 2) * flight_noise_row(n);
    const size_t of_linear = N_LOADS * linear_noise_row(&e->map);
    const size_t channels = first_other(e) + 2 * other_count(e);
    return filter_create(file, &e->inputs, channels, e->flight.present ? of_flight : of_linear, &e->filter);
}

static double time_constant(const Estimator *e) {
    return e->inputs.value[filter_setting(&e->inputs)];
}

int estimator_filters(const Estimator *e) {
    const int takes_steps = (e->base.mode & (EVENT | CONTINUOUS_TIME)) == 0; /* not in model exchange */
    return e->filter.present && takes_steps && time_constant(e) > 0.0;
}

static double square(double x) {
    return x * x;
}

/* Values and variances of outputs from a channel on. */
static void set_channels(Filter *filter, size_t channel, size_t count, const double *value, const double *std) {
    for (size_t k = 0; k < count; k++) {
        filter->value[channel + k] = value[k];
        filter->variance[channel + k] = square(std[k]);
    }
}

static void set_loads(Estimator *e) {
    Filter *filter = &e->filter;
    const size_t m = other_count(e), first = first_other(e);
    set_channels(filter, LOAD_CHANNELS, N_LOADS, e->output + LOADS, e->output + LOADS_STD);
    set_channels(filter, COEFFICIENT_CHANNELS, N_LOADS, e->output + COEFFICIENTS, e->output + COEFFICIENTS_STD);
    if (m > 0) {
        double *const *value = e->other_loads.value;
        estimator_other_loads(e);
        set_channels(filter, first, m, value[OTHER_LOADS], value[OTHER_LOADS_STD]);
        set_channels(filter, first + m, m, value[OTHER_COEFFICIENTS], value[OTHER_COEFFICIENTS_STD]);
    }
}

static void set_linear_noise(Estimator *e) {
    Filter *filter = &e->filter;
    const size_t first = first_other(e), m = other_count(e);
    const double *gauge = filter->map.noise, of_pressure = filter->map.white_navigation;
    linear_noise(&e->linear, gauge, of_pressure, filter->row, filter->noise + LOAD_CHANNELS,
                 filter->noise + COEFFICIENT_CHANNELS);
    if (m > 0) {
        linear_other_noise(&e->linear, gauge, of_pressure, filter->row, filter->noise + first, filter->noise + first + m);
    }
}

/* Sum of squares of a row, and of that with another one a number of times. */
static double square_of_rows(size_t count, double own, const double *row, double times, const double *other) {
    double sum = 0.0;
    for (size_t g = 0; g < count; g++) {
        sum += square(own * row[g] + times * other[g]);
    }
    return sum;
}

static void set_flight_noise(Estimator *e) {
    Filter *filter = &e->filter;
    const FlightSolver *solver = &e->flight.solver;
    const FlightMap *map = &e->flight.map;
    const size_t row = flight_noise_row(solver->n_gauges), first = first_other(e), m = other_count(e);
    const double *gauge = filter->map.noise, *scalar = e->inputs.value + e->map.n_gauges;
    const double shift = moment_shift(&e->inputs);
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
        flight_other_noise(&e->flight.other_loads, solver, &e->inputs, &e->other_loads, gauge, rows,
                           rows + (N_NOISE_ROWS + N_STATES + N_LOADS) * row, filter->noise + first,
                           filter->noise + first + m);
    }
}

/* Whether the estimate of the sample alone is one, and strain fits the map. */
static int is_estimate(const Estimator *e) {
    const int health = (int)e->output[HEALTH_STATE];
    if (e->flight.present) {
        return e->output[VALID_GAUGES] > 0.0 && e->flight.fits && !e->flight.flag[LINEAR_LOADS];
    }
    return health != INVALID && health != UNIDENTIFIED && health != NO_COEFFICIENTS
        && e->output[CHI_SQUARE] <= e->output[CHI_SQUARE_LIMIT];
}

/* The estimate of the sample alone, and its noise, to the channels. */
static void set_sample(Estimator *e) {
    Filter *filter = &e->filter;
    set_loads(e);
    if (e->flight.present) {
        const Solution *found = &e->flight.solver.solution;
        for (size_t k = 0; k < N_STATES; k++) {
            filter->value[STATE_CHANNELS + k] = found->state[k];
            filter->variance[STATE_CHANNELS + k] = found->widened_covariance[k * (N_STATES + 1)];
        }
        set_flight_noise(e);
    } else {
        set_linear_noise(e);
    }
}

/* Filtered values and their deviations from a channel on. */
static void write_channels(const Filter *filter, size_t channel, size_t count, double *value, double *std) {
    for (size_t k = 0; k < count; k++) {
        value[k] = filter->mean[channel + k];
        std[k] = sqrt(filter->left[channel + k]);
    }
}

static void write_flight(Estimator *e) {
    Flight *flight = &e->flight;
    const double *factor = e->filter.factor + STATE_CHANNELS;
    Solution filtered = flight->solver.solution;
    memcpy(filtered.state, e->filter.mean + STATE_CHANNELS, sizeof filtered.state);
    for (size_t i = 0; i < N_STATES; i++) {
        for (size_t j = 0; j < N_STATES; j++) {
            filtered.widened_covariance[i * N_STATES + j] *= factor[i] * factor[j];
        }
    }
    flight_air_data(&flight->map, flight->prior_std, &filtered, flight->real, flight->flag);
}

static void write_filtered(Estimator *e) {
    const Filter *filter = &e->filter;
    const size_t m = other_count(e), first = first_other(e);
    write_channels(filter, LOAD_CHANNELS, N_LOADS, e->output + LOADS, e->output + LOADS_STD);
    write_channels(filter, COEFFICIENT_CHANNELS, N_LOADS, e->output + COEFFICIENTS, e->output + COEFFICIENTS_STD);
    if (m > 0) {
        double *const *value = e->other_loads.value;
        write_channels(filter, first, m, value[OTHER_LOADS], value[OTHER_LOADS_STD]);
        write_channels(filter, first + m, m, value[OTHER_COEFFICIENTS], value[OTHER_COEFFICIENTS_STD]);
    }
    if (e->flight.present) {
        write_flight(e);
    }
}

void estimator_filter_outputs(Estimator *e) {
    Filter *filter = &e->filter;
    if (is_estimate(e)) {
        set_sample(e);
        if (filter_sample(filter, &e->inputs, time_constant(e)) && filter->part_left < 1.0) {
            write_filtered(e);
        }
        return;
    }
    const double since = filter_no_sample(filter, &e->inputs);
    if (e->flight.present && e->output[VALID_GAUGES] == 0.0 && since >= 0.0) {
        flight_coast(&e->flight, filter, since);
    }
}
