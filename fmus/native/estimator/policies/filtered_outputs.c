/* The outputs by the filter: which numbers are its channels, the noise in each, and where filtered values go.

   Channels of every map are five loads and five coefficients as they are put out; of a map with tables then the
   flight state (M, u, w, ln p_inf); then loads and coefficients in addition to the five. Each has the value and
   variance of the sample alone, and nu, the part of the variance that noise makes: responses of the solution to
   noise, squared (linear/linear_noise.c, nonlinear/flight_noise.c). At moment point and references of the settings a
   row of a moment is row_M + shift row_F, so that rows are combined before they are squared.

   Filtered values replace loads and coefficients; air data follow from the filtered state, whose covariance is the
   sample's with rows and columns times the factors of its channels. Health, chi-square and residuals stay the single
   sample's. A sample that does not fit the map, or whose loads come from the linear map instead of the tables, is
   not averaged; without any strain a map with tables coasts (coast.c). docs/explanation/filter.md, "Model" and "What
   does not fit". */

#include "filtered_outputs.h"

#include <math.h>

#include "../linear/linear_noise.h"
#include "../nonlinear/flight_noise.h"
#include "coast.h"
#include "flight.h"

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

/* Values and variances of outputs from a channel on. */
static void set_channels(Filter *filter, size_t channel, size_t count, const double *value, const double *std) {
    for (size_t k = 0; k < count; k++) {
        filter->value[channel + k] = value[k];
        filter->variance[channel + k] = square(std[k]);
    }
}

static void set_loads(Filter *filter, Flight *flight) {
    const size_t m = other_count(flight), first = first_other(flight);
    const double *output = flight->output;
    set_channels(filter, LOAD_CHANNELS, N_LOADS, output + LOADS, output + LOADS_STD);
    set_channels(filter, COEFFICIENT_CHANNELS, N_LOADS, output + COEFFICIENTS, output + COEFFICIENTS_STD);
    if (m > 0) {
        double *const *value = flight->loads->value;
        flight_other_loads_update(flight);
        set_channels(filter, first, m, value[OTHER_LOADS], value[OTHER_LOADS_STD]);
        set_channels(filter, first + m, m, value[OTHER_COEFFICIENTS], value[OTHER_COEFFICIENTS_STD]);
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

/* Filtered values and their standard deviations from a channel on. */
static void write_channels(const Filter *filter, size_t channel, size_t count, double *value, double *std) {
    for (size_t k = 0; k < count; k++) {
        value[k] = filter->mean[channel + k];
        std[k] = sqrt(filter->left[channel + k]);
    }
}

static void write_flight(const Filter *filter, Flight *flight) {
    const double *factor = filter->factor + STATE_CHANNELS;
    Solution filtered = flight->solver.solution;
    memcpy(filtered.state, filter->mean + STATE_CHANNELS, sizeof filtered.state);
    for (size_t i = 0; i < N_STATES; i++) {
        for (size_t j = 0; j < N_STATES; j++) {
            filtered.widened_covariance[i * N_STATES + j] *= factor[i] * factor[j];
        }
    }
    flight_air_data(&flight->map, flight->prior_std, &filtered, flight->real, flight->flag);
}

static void write_filtered(const Filter *filter, Flight *flight) {
    const size_t m = other_count(flight), first = first_other(flight);
    double *output = flight->output;
    write_channels(filter, LOAD_CHANNELS, N_LOADS, output + LOADS, output + LOADS_STD);
    write_channels(filter, COEFFICIENT_CHANNELS, N_LOADS, output + COEFFICIENTS, output + COEFFICIENTS_STD);
    if (m > 0) {
        double *const *value = flight->loads->value;
        write_channels(filter, first, m, value[OTHER_LOADS], value[OTHER_LOADS_STD]);
        write_channels(filter, first + m, m, value[OTHER_COEFFICIENTS], value[OTHER_COEFFICIENTS_STD]);
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
