/* Loads at a solution of the tables, corrected by what strain shows beyond them; coefficients; their covariances.

   At the state x with residual r = d - y(x), Jacobians J (n, 4) of strain and J_L (5, 4) of loads, and the
   covariance Gamma_Ld (5, n) of loads with strain by the errors that the gain may correct,

       f = L(x) + K r,      K = Gamma_Ld S^-1.

   By the factor L of S, `turned` = L^-1 Gamma_dL and `right` = L^-1 [r, J]: K r = turned' right_0 and K J = turned'
   right_1..4 (flight_corrected). What the estimate is worth follows from the full model, S_full with the considered
   errors:

       f_full = L(x) + K_full r + (J_L - K_full J) shift
       C_full = (J_L - K_full J) H_full^-1 (J_L - K_full J)' + Gamma_LL - K_full Gamma_dL
       cov f  = C_full + (f - f_full)(f - f_full)'

   f - f_full is `apart`; it is the error that the gain leaves of the considered errors, given this sample.
   Coefficients C = f / (q S_ref) have the derivatives scale (J_L - K J) - C d ln q/dx, with ln q = ln(gamma/2) + 2
   ln M + ln p. An error of ln q is normal, an error of q is not: `wider` makes three standard deviations of q reach
   as far as three of ln q, (e^(3 s) - 1) / 3 over s, squared.

   Rows beyond the five loads use the same functions (flight_other_loads.c). docs/explanation/nonlinear_estimator.md,
   "Roles of the errors" and "Estimate"; concluded and flight_loads in strainfmu/estimator/reference/nonlinear.py.
   Source of considered errors: Schmidt, Advances in Control Systems 3 (1966) 293. */

#include "flight_loads.h"

#include <math.h>

#include "../../core/elementary.h"
#include "../numerics/cholesky.h"

/* (e^x - 1) / 3 for x = 3 s; by its series for small x, where the difference would cancel. */
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

static double along_state(const double *by_state, const double *shift) {
    double sum = 0.0;
    for (size_t k = 0; k < N_STATES; k++) {
        sum += by_state[k] * shift[k];
    }
    return sum;
}

/* q_inf at the solution, d ln q/dx, ln q less the full model's, and the square of `wider`. */
PressureErrors flight_pressure_errors(const FlightSolver *solver) {
    const FullModel *full = &solver->full;
    const double mach = solver->state[STATE_MACH];
    PressureErrors pressure = {.dynamic = solver->map->half_gamma * mach * mach * solver->response.pressure,
                            .by_state = {2.0 / mach, 0.0, 0.0, 1.0}};
    pressure.apart = -along_state(pressure.by_state, full->shift);
    const double variance = quadratic(N_STATES, pressure.by_state, full->state_covariance, pressure.by_state);
    const double of_log = sqrt(variance + pressure.apart * pressure.apart);
    const double widening = lognormal_deviation(of_log) / of_log;
    pressure.wider = widening * widening;
    return pressure;
}

/* L^-1 Gamma_dL of `count` loads, at the pressure that L belongs to. */
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

double flight_corrected(const FlightSolver *solver, const double *right, const Response *response, size_t row,
                        const double *turned, double *by_state) {
    const size_t n = solver->n;
    for (size_t k = 0; k < N_STATES; k++) {
        by_state[k] = response->jacobian[k][row] - lane_dot(n, turned, right + (1 + k) * n);
    }
    return response->value[row] + lane_dot(n, turned, right);
}

/* The load of the considered error with tables of its own; 0 without. */
static double of_tables(const FlightSolver *solver, size_t load) {
    return solver->map->considered.n_rows > 0 ? solver->full.response.value[solver->n_gauges + load] : 0.0;
}

/* L_full^-1 of the same and of the considered errors' Gamma_dL; an error with tables adds its strain times its load. */
void flight_turn_full(const FlightSolver *solver, const double *strain_covariance, const double *considered,
                      size_t first, size_t count, double *turned) {
    const size_t n = solver->n, n_gauges = solver->n_gauges;
    const double square = solver->response.pressure * solver->response.pressure;
    const double *of_error = solver->map->considered.n_rows > 0 ? solver->full.response.value : NULL;
    memset(turned, 0, count * n * sizeof *turned);
    for (size_t i = 0; i < count; i++) {
        const double load = of_tables(solver, first + i);
        for (size_t g = 0; g < n_gauges; g++) {
            const size_t at = i * n_gauges + g;
            const double both = square * (strain_covariance[at] + considered[at]);
            turned[i * n + g] = !solver->sample.used[g] ? 0.0 : of_error != NULL ? both + load * of_error[g] : both;
        }
    }
    solve_lower(solver->wide, n, solver->full.factor, count, turned);
}

/* J_L - K_full J and f - f_full of a row, and both of its coefficient. */
LoadErrors flight_load_errors(const FlightSolver *solver, const PressureErrors *pressure, const Response *response,
                              size_t row, double value, const double *turned, double scale) {
    const FullModel *full = &solver->full;
    LoadErrors errors;
    const double of_full = flight_corrected(solver, full->right, response, row, turned, errors.by_state);
    errors.apart = value - of_full - along_state(errors.by_state, full->shift);
    for (size_t k = 0; k < N_STATES; k++) {
        errors.of_coefficient[k] = scale * errors.by_state[k] - scale * value * pressure->by_state[k];
    }
    errors.coefficient_apart = scale * errors.apart - scale * value * pressure->apart;
    return errors;
}

/* Gamma_LL - K_full Gamma_dL of two loads: what strain leaves of them at a fixed state. */
double flight_load_square(const FlightSolver *solver, double square, size_t load, size_t other, const double *turned,
                          const double *other_turned) {
    const double pressure = solver->response.pressure;
    return pressure * pressure * square + of_tables(solver, load) * of_tables(solver, other)
         - lane_dot(solver->n, turned, other_turned);
}

void flight_set_loads(FlightSolver *solver) {
    const FlightMap *map = solver->map;
    const size_t n = solver->n;
    FullModel *full = &solver->full;
    Solution *solution = &solver->solution;
    double *turned = solver->turned, by_state[N_STATES], scale[N_LOADS];
    LoadErrors errors[N_LOADS];
    for (size_t i = 0; i < N_STATES; i++) {
        for (size_t j = 0; j < N_STATES; j++) {
            const size_t at = i * N_STATES + j;
            solution->widened_covariance[at] = full->state_covariance[at] + full->shift[i] * full->shift[j];
        }
    }
    const PressureErrors pressure = flight_pressure_errors(solver);
    flight_turn(solver, map->load_strain_covariance, N_LOADS, turned);
    flight_turn_full(solver, map->load_strain_covariance, map->considered_load_strain_covariance, 0, N_LOADS, full->turned);
    for (size_t i = 0; i < N_LOADS; i++) {
        const size_t row = solver->n_gauges + i;
        const double reference = i < 3 ? map->reference_area : map->reference_area * map->reference_length;
        scale[i] = 1.0 / (pressure.dynamic * reference);
        solution->loads[i] = flight_corrected(solver, solver->right, &solver->response, row, turned + i * n, by_state);
        solution->coefficients[i] = scale[i] * solution->loads[i];
        errors[i] = flight_load_errors(solver, &pressure, &solver->response, row, solution->loads[i], full->turned + i * n,
                                       scale[i]);
    }
    for (size_t i = 0; i < N_LOADS; i++) {
        for (size_t j = 0; j < N_LOADS; j++) {
            const size_t at = i * N_LOADS + j;
            const double remaining =
                flight_load_square(solver, map->load_covariance[at] + map->considered_load_covariance[at], i, j,
                                   full->turned + i * n, full->turned + j * n);
            solution->load_covariance[at] =
                quadratic(N_STATES, errors[i].by_state, full->state_covariance, errors[j].by_state) + remaining
                + errors[i].apart * errors[j].apart;
            solution->coefficient_covariance[at] =
                pressure.wider
                * (quadratic(N_STATES, errors[i].of_coefficient, full->state_covariance, errors[j].of_coefficient)
                   + scale[i] * remaining * scale[j] + errors[i].coefficient_apart * errors[j].coefficient_apart);
        }
    }
}
