#include "filter_solution.h"

#include <math.h>

#include "../nonlinear/flight_loads.h"
#include "../numerics/cholesky.h"
#include "../numerics/products.h"

/* Gains of the loads on the residual: covariance with the strain of the directions that are not estimated, times that of
   strain inverted; columns (rows, N_COLUMNS) in filter->right. `remaining` gets what they leave of the loads'
   covariance. */
static void set_turned(Filter *filter, double remaining[N_LOADS][N_LOADS]) {
    const FlightSolver *solver = filter->solver;
    const size_t rows = filter->rows, gauges = filter->gauges, n = solver->n_gauges;
    const double square = solver->response.pressure * solver->response.pressure;
    double *turned = filter->right, product[N_COLUMNS * N_COLUMNS];
    memset(turned, 0, N_COLUMNS * rows * sizeof *turned);
    for (size_t g = 0; g < n; g++) {
        for (size_t i = 0; i < N_LOADS; i++) {
            turned[g * N_COLUMNS + i] = solver->sample.used[g] ? square * filter->errors.rest_cross[i * n + g] : 0.0;
        }
    }
    /* What is left of navigation is independent of strain: gauges alone are decomposed. */
    cholesky(solver->wide, gauges, rows, filter->white);
    invert_diagonals(gauges, rows, filter->white, filter->product);
    solve_lower_columns(solver->wide, gauges, rows, filter->white, filter->product, turned);
    multiply(solver->wide, FULL, N_COLUMNS, gauges, N_COLUMNS, (Strided){turned, 1, N_COLUMNS}, turned, N_COLUMNS,
             product, N_COLUMNS);
    for (size_t i = 0; i < N_LOADS; i++) {
        for (size_t j = 0; j < N_LOADS; j++) {
            remaining[i][j] = square * filter->errors.rest_load[i * N_LOADS + j] - product[i * N_COLUMNS + j];
        }
    }
    solve_upper_columns(solver->wide, gauges, rows, filter->white, filter->product, turned);
}

double *filter_left(Filter *filter, const Law *law) {
    const FlightSolver *solver = filter->solver;
    const size_t rows = filter->rows;
    double *left = filter->product;
    memset(left, 0, rows * sizeof *left);
    for (size_t g = 0; g < solver->n_gauges; g++) {
        left[g] = solver->sample.used[g] ? solver->sample.strain[g] - solver->response.value[g] : 0.0;
    }
    subtract_product(solver->wide, 1, filter->n_read - FIRST_SEEN, filter->gauges, by_rows(law->mean + FIRST_SEEN, 0),
                     filter->read + FIRST_SEEN * rows, rows, left, rows);
    return left;
}

/* Loads, and their Jacobian by the states, (N_LOADS, order) in filter->joseph. */
static void set_loads(Filter *filter) {
    FlightSolver *solver = filter->solver;
    const size_t rows = filter->rows, order = filter->laws.order;
    const double *left = filter_left(filter, &filter->laws.next_law), *mean = filter->laws.next_law.mean;
    double *by_state = filter->joseph, *by_read = filter->turned, of_left[N_COLUMNS];
    memset(by_state, 0, N_LOADS * order * sizeof *by_state);
    multiply(solver->wide, FULL, filter->n_read, filter->gauges, N_COLUMNS, by_rows(filter->read, rows), filter->right,
             N_COLUMNS, by_read, N_COLUMNS);
    multiply(solver->wide, FULL, 1, filter->gauges, N_COLUMNS, by_rows(left, rows), filter->right, N_COLUMNS, of_left,
             N_COLUMNS);
    for (size_t i = 0; i < N_LOADS; i++) {
        double *row = by_state + i * order, sum = solver->response.value[solver->n_gauges + i];
        for (size_t k = 0; k < N_STATES; k++) {
            row[k] = solver->response.jacobian[k][solver->n_gauges + i];
        }
        for (size_t k = 0; k < filter->map.n_seen; k++) {
            row[FIRST_SEEN + k] = solver->response.pressure * filter->errors.load[k * N_LOADS + i];
            sum += row[FIRST_SEEN + k] * mean[FIRST_SEEN + k];
        }
        for (size_t k = 0; k < filter->n_read; k++) {
            row[k] -= by_read[k * N_COLUMNS + i];
        }
        solver->solution.loads[i] = sum + of_left[i];
    }
}

void filter_solution(Filter *filter) {
    FlightSolver *solver = filter->solver;
    const FlightMap *map = solver->map;
    Solution *found = &solver->solution;
    const size_t order = filter->laws.order;
    const double *covariance = filter->laws.next_law.covariance, *by_state = filter->joseph;
    const double mach = solver->state[STATE_MACH], pressure = solver->response.pressure;
    const double dynamic = map->half_gamma * mach * mach * pressure;
    double remaining[N_LOADS][N_LOADS], scale[N_LOADS], *of_coefficient = filter->joseph + N_LOADS * order;
    set_turned(filter, remaining);
    set_loads(filter);
    memcpy(found->state, solver->state, sizeof found->state);
    for (size_t k = 0; k < N_STATES; k++) {
        memcpy(found->state_covariance + k * N_STATES, covariance + k * order, N_STATES * sizeof *covariance);
    }
    memcpy(found->widened_covariance, found->state_covariance, sizeof found->widened_covariance);
    memset(found->widening, 0, sizeof found->widening);
    const double of_pressure[N_STATES] = {2.0 / mach, 0.0, 0.0, 1.0};
    const double of_log = sqrt(quadratic(N_STATES, of_pressure, found->state_covariance, of_pressure));
    const double widening = lognormal_deviation(of_log) / of_log, wider = widening * widening;
    for (size_t i = 0; i < N_LOADS; i++) {
        const double reference = i < 3 ? map->reference_area : map->reference_area * map->reference_length;
        scale[i] = 1.0 / (dynamic * reference);
        found->coefficients[i] = scale[i] * found->loads[i];
        for (size_t k = 0; k < order; k++) {
            of_coefficient[i * order + k] =
                scale[i] * by_state[i * order + k] - (k < N_STATES ? found->coefficients[i] * of_pressure[k] : 0.0);
        }
    }
    /* Both times the covariance, then each other. */
    double *times = filter->joseph + 2 * N_LOADS * order;
    multiply(solver->wide, FULL, 2 * N_LOADS, filter->laws.n, order, by_rows(by_state, order), covariance, order, times,
             order);
    for (size_t i = 0; i < N_LOADS; i++) {
        for (size_t j = 0; j < N_LOADS; j++) {
            const size_t at = i * N_LOADS + j, of = N_LOADS + i;
            found->load_covariance[at] = lane_dot(order, times + i * order, by_state + j * order) + remaining[i][j];
            found->coefficient_covariance[at] =
                wider * (lane_dot(order, times + of * order, of_coefficient + j * order)
                         + scale[i] * remaining[i][j] * scale[j]);
        }
    }
    found->shape_square = 0.0; /* they are estimated */
}
