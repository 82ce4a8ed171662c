#include "flight_loads.h"

#include <math.h>

#include "../../core/elementary.h"
#include "../numerics/cholesky.h"

double lognormal_deviation(double of_log) {
    const double x = 3.0 * of_log;
    if (!(x < 0.5)) {
        return (exponential(x) - 1.0) / 3.0;
    }
    double sum = 1.0; /* (e^x - 1) / x */
    for (int k = 16; k > 1; k--) {
        sum = 1.0 + sum * x / k;
    }
    return x * sum / 3.0;
}

double flight_along(const double *by_state, const double *shift) {
    double sum = 0.0;
    for (size_t k = 0; k < N_STATES; k++) {
        sum += by_state[k] * shift[k];
    }
    return sum;
}

PressureErrors flight_pressure_errors(const FlightSolver *solver) {
    const double mach = solver->state[STATE_MACH];
    PressureErrors found = {.dynamic = solver->map->half_gamma * mach * mach * solver->response.pressure,
                            .by_state = {2.0 / mach, 0.0, 0.0, 1.0}};
    const double considered = flight_along(found.by_state, solver->considered.shift);
    const double of_log = sqrt(quadratic(N_STATES, found.by_state, solver->solution.state_covariance, found.by_state)
                               + considered * considered);
    const double widening = lognormal_deviation(of_log) / of_log;
    found.wider = widening * widening;
    return found;
}

void flight_turn(const FlightSolver *solver, const double *strain_covariance, size_t count, double *turned) {
    const size_t n = solver->n, n_gauges = solver->n_gauges;
    const double square = solver->factor_pressure * solver->factor_pressure;
    memset(turned, 0, count * n * sizeof *turned);
    for (size_t i = 0; i < count; i++) {
        for (size_t g = 0; g < n_gauges; g++) {
            turned[i * n + g] = solver->sample.used[g] ? square * strain_covariance[i * n_gauges + g] : 0.0;
        }
    }
    solve_lower(solver->wide, n, solver->factor, count, turned);
}

double flight_corrected(const FlightSolver *solver, const Response *response, size_t row, const double *turned,
                        double *by_state) {
    const size_t n = solver->n;
    for (size_t k = 0; k < N_STATES; k++) {
        by_state[k] = response->jacobian[k][row] - lane_dot(n, turned, solver->right + (1 + k) * n);
    }
    return response->value[row] + lane_dot(n, turned, solver->right);
}

/* The considered error: L^-1 of its strain, and the error of the state where strain has that error. It is as large as the
   residual leaves it: with P as in flight_settle, the posterior of a standard normal amplitude has the variance 1 / (1 + h' P h)
   about h' P r / (1 + h' P h), and the sum of the squares counts. It corrects nothing. */
static void set_considered(FlightSolver *solver) {
    Considered *considered = &solver->considered;
    const size_t n = solver->n;
    const double *covariance = solver->solution.state_covariance;
    double by_error[N_STATES], *strain = considered->strain;
    memset(considered->shift, 0, sizeof considered->shift);
    if (solver->map->considered.n_rows == 0) {
        return;
    }
    flight_response(&considered->tables, solver->wide, solver->state, &considered->response);
    memset(strain, 0, n * sizeof *strain);
    for (size_t g = 0; g < solver->n_gauges; g++) {
        strain[g] = solver->sample.used[g] ? considered->response.value[g] : 0.0;
    }
    solve_lower(solver->wide, n, solver->factor, 1, strain);
    for (size_t k = 0; k < N_STATES; k++) {
        by_error[k] = lane_dot(n, solver->right + (1 + k) * n, strain);
    }
    const double seen = lane_dot(n, strain, strain) - quadratic(N_STATES, by_error, covariance, by_error);
    const double found = lane_dot(n, strain, solver->right) - quadratic(N_STATES, by_error, covariance, solver->gradient);
    const double precision = 1.0 + (seen > 0.0 ? seen : 0.0), mean = found / precision;
    considered->size = sqrt(1.0 / precision + mean * mean);
    for (size_t g = 0; g < n; g++) {
        strain[g] *= considered->size;
    }
    for (size_t k = 0; k < N_STATES; k++) {
        considered->shift[k] = considered->size * flight_along(covariance + k * N_STATES, by_error);
    }
}

double flight_considered(const FlightSolver *solver, size_t load, const double *turned) {
    const Considered *considered = &solver->considered;
    return solver->map->considered.n_rows == 0
             ? 0.0
             : lane_dot(solver->n, turned, considered->strain)
                   - considered->size * considered->response.value[solver->n_gauges + load];
}

void flight_set_loads(FlightSolver *solver) {
    const FlightMap *map = solver->map;
    const size_t n = solver->n;
    const double square = solver->factor_pressure * solver->factor_pressure;
    set_considered(solver);
    const double *shift = solver->considered.shift;
    const PressureErrors pressure = flight_pressure_errors(solver);
    Solution *found = &solver->solution;
    double of_load[N_LOADS], of_both[N_LOADS]; /* the considered error of loads and of coefficients */
    double *turned = solver->turned, by_state[N_LOADS][N_STATES], of_coefficient[N_LOADS][N_STATES], scale[N_LOADS];
    flight_turn(solver, map->load_strain_covariance, N_LOADS, turned);
    for (size_t i = 0; i < N_LOADS; i++) {
        const double reference = i < 3 ? map->reference_area : map->reference_area * map->reference_length;
        scale[i] = 1.0 / (pressure.dynamic * reference);
        found->loads[i] =
            flight_corrected(solver, &solver->response, solver->n_gauges + i, turned + i * n, by_state[i]);
        found->coefficients[i] = scale[i] * found->loads[i];
        for (size_t k = 0; k < N_STATES; k++) {
            of_coefficient[i][k] = scale[i] * by_state[i][k] - found->coefficients[i] * pressure.by_state[k];
        }
        const double own = flight_considered(solver, i, turned + i * n);
        of_load[i] = flight_along(by_state[i], shift) + own;
        of_both[i] = flight_along(of_coefficient[i], shift) + scale[i] * own;
    }
    for (size_t i = 0; i < N_LOADS; i++) {
        for (size_t j = 0; j < N_LOADS; j++) {
            const size_t at = i * N_LOADS + j;
            const double remaining =
                square * map->load_covariance[at] - lane_dot(n, turned + i * n, turned + j * n);
            found->load_covariance[at] =
                quadratic(N_STATES, by_state[i], found->state_covariance, by_state[j]) + remaining + of_load[i] * of_load[j];
            found->coefficient_covariance[at] =
                pressure.wider * (quadratic(N_STATES, of_coefficient[i], found->state_covariance, of_coefficient[j])
                                  + scale[i] * remaining * scale[j] + of_both[i] * of_both[j]);
        }
    }
}
