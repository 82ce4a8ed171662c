#include "filter_other_loads.h"

#include <math.h>
#include <string.h>

#include "../nonlinear/flight_loads.h"
#include "../numerics/cholesky.h"
#include "filter_solution.h"

/* What is known of a load. */
typedef struct {
    double load, remaining;
    const double *by_state; /* (order) */
} FilteredLoad;

/* L^-1 of covariances with strain of the directions that are not estimated, then of L'^-1 L^-1; between them what they
   leave of the loads' variances, in `remaining`. */
static void set_turned(Filter *filter, double square, double *remaining) {
    const FlightSolver *solver = filter->solver;
    const FilterMap *map = &filter->map;
    const size_t rows = filter->rows, n = solver->n_gauges, m = map->n_other;
    double *turned = filter->other_turned;
    memset(turned, 0, m * rows * sizeof *turned);
    for (size_t j = 0; j < m; j++) {
        for (size_t g = 0; g < n; g++) {
            turned[j * rows + g] = solver->sample.used[g] ? square * filter->errors.other_cross[j * n + g] : 0.0;
        }
    }
    solve_lower(solver->wide, rows, filter->white, m, turned);
    for (size_t j = 0; j < m; j++) {
        const double left = square * filter->errors.other_variance[j] - lane_dot(rows, turned + j * rows, turned + j * rows);
        remaining[j] = left > 0.0 ? left : 0.0; /* of a load that strain tells wholly, rounding leaves less */
    }
    solve_upper(solver->wide, rows, filter->white, m, turned);
}

/* Load j, and its derivative by the states. */
static FilteredLoad load_of(Filter *filter, const Response *response, size_t j, const double *left, double remaining) {
    const FilterMap *map = &filter->map;
    const size_t rows = filter->rows;
    const double *turned = filter->other_turned + j * rows, *mean = filter->found.mean;
    double *by_state = filter->other_by_state, sum = response->value[j];
    memset(by_state, 0, filter->laws.order * sizeof *by_state);
    for (size_t k = 0; k < N_STATES; k++) {
        by_state[k] = response->jacobian[k][j];
    }
    for (size_t k = 0; k < map->n_seen; k++) {
        by_state[FIRST_SEEN + k] = response->pressure * filter->errors.other_load[j * map->n_seen + k];
        sum += by_state[FIRST_SEEN + k] * mean[FIRST_SEEN + k];
    }
    for (size_t k = 0; k < filter->n_read; k++) {
        by_state[k] -= lane_dot(rows, turned, filter->read + k * rows);
    }
    return (FilteredLoad){sum + lane_dot(rows, turned, left), remaining, by_state};
}

/* x' P x of the law's covariance. */
static double spread_of(const Filter *filter, const double *x) {
    double sum = 0.0;
    for (size_t i = 0; i < filter->laws.n; i++) {
        sum += x[i] * lane_dot(filter->laws.order, filter->found.covariance + i * filter->laws.order, x);
    }
    return sum;
}

/* Write load j to the outputs, at the references of the settings. */
static void write(const Filter *filter, const Inputs *inputs, size_t j, const FilteredLoad *found,
                  const PressureErrors *pressure, OtherLoads *out) {
    const FlightMap *map = filter->solver->map;
    const double *settings = inputs->value + inputs->map->n_gauges;
    const int is_moment = out->map.is_moment[j] > 0.0;
    const double reference = map->reference_area * (is_moment ? map->reference_length : 1.0);
    const double own = settings[REFERENCE_AREA] * (is_moment ? settings[REFERENCE_LENGTH] : 1.0);
    const double scale = 1.0 / (pressure->dynamic * reference), turn = reference / own;
    double *of_coefficient = filter->other_by_state + filter->laws.order;
    for (size_t k = 0; k < filter->laws.order; k++) {
        of_coefficient[k] =
            scale * found->by_state[k] - (k < N_STATES ? scale * found->load * pressure->by_state[k] : 0.0);
    }
    const double variance = spread_of(filter, found->by_state) + found->remaining;
    const double of_both = spread_of(filter, of_coefficient) + scale * scale * found->remaining;
    out->value[OTHER_LOADS][j] = found->load;
    out->value[OTHER_LOADS_STD][j] = sqrt(variance);
    out->value[OTHER_COEFFICIENTS][j] = turn * (scale * found->load);
    out->value[OTHER_COEFFICIENTS_STD][j] = turn * sqrt(pressure->wider * of_both);
}

void filter_other_loads(Filter *filter, FlightOtherLoads *other_loads, const Inputs *inputs, OtherLoads *out) {
    const FlightSolver *solver = filter->solver;
    const size_t m = filter->map.n_other;
    double *remaining = out->value[OTHER_LOADS_STD]; /* each until its load is written */
    flight_response(&other_loads->tables, solver->wide, solver->state, &other_loads->response);
    set_turned(filter, solver->response.pressure * solver->response.pressure, remaining);
    static const double NONE[N_STATES] = {0.0};
    const PressureErrors pressure = flight_pressure_errors(solver, NONE);
    const double *left = filter_left(filter, &filter->found);
    for (size_t j = 0; j < m; j++) {
        const FilteredLoad found = load_of(filter, &other_loads->response, j, left, remaining[j]);
        write(filter, inputs, j, &found, &pressure, out);
    }
}
