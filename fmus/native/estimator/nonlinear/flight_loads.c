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

PressureErrors flight_pressure_errors(const FlightSolver *solver) {
    const double mach = solver->state[STATE_MACH];
    PressureErrors found = {.dynamic = solver->map->half_gamma * mach * mach * solver->response.pressure,
                            .by_state = {2.0 / mach, 0.0, 0.0, 1.0}};
    const double of_log =
        sqrt(quadratic(N_STATES, found.by_state, solver->solution.state_covariance, found.by_state));
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

void flight_set_loads(FlightSolver *solver) {
    const FlightMap *map = solver->map;
    const size_t n = solver->n;
    const double square = solver->factor_pressure * solver->factor_pressure;
    const PressureErrors pressure = flight_pressure_errors(solver);
    Solution *found = &solver->solution;
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
    }
    for (size_t i = 0; i < N_LOADS; i++) {
        for (size_t j = 0; j < N_LOADS; j++) {
            const size_t at = i * N_LOADS + j;
            const double remaining =
                square * map->load_covariance[at] - lane_dot(n, turned + i * n, turned + j * n);
            found->load_covariance[at] =
                quadratic(N_STATES, by_state[i], found->state_covariance, by_state[j]) + remaining;
            found->coefficient_covariance[at] =
                pressure.wider * (quadratic(N_STATES, of_coefficient[i], found->state_covariance, of_coefficient[j])
                                  + scale[i] * remaining * scale[j]);
        }
    }
}
