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

static double along_state(const double *by_state, const double *shift) {
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
    double variance = quadratic(N_STATES, found.by_state, solver->solution.state_covariance, found.by_state);
    for (size_t j = 0; j < solver->map->n_considered; j++) {
        const double of_error = along_state(found.by_state, solver->considered.shift[j]);
        variance += of_error * of_error;
    }
    const double of_log = sqrt(variance);
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

/* L^-1 of the strain of each considered error. */
static void set_considered_strain(FlightSolver *solver) {
    const FlightMap *map = solver->map;
    const size_t n_gauges = solver->n_gauges, first = map->considered.n_rows > 0;
    double *strain = solver->considered.strain;
    memset(strain, 0, map->n_considered * solver->n * sizeof *strain);
    if (first) {
        flight_response(&solver->considered.tables, solver->wide, solver->state, &solver->considered.response);
    }
    for (size_t j = 0; j < map->n_considered; j++) {
        const double *source =
            j < first ? solver->considered.response.value : map->considered_strain + (j - first) * n_gauges;
        for (size_t g = 0; g < n_gauges; g++) {
            strain[j * solver->n + g] = solver->sample.used[g] ? source[g] : 0.0;
        }
    }
    solve_lower(solver->wide, solver->n, solver->factor, map->n_considered, strain);
}

/* L (order, order) of M = L L', and 0 above its diagonal. */
static void factor_small(size_t order, const double *matrix, double *lower) {
    memset(lower, 0, order * order * sizeof *lower);
    for (size_t i = 0; i < order; i++) {
        for (size_t j = 0; j <= i; j++) {
            double rest = matrix[i * order + j];
            for (size_t k = 0; k < j; k++) {
                rest -= lower[i * order + k] * lower[j * order + k];
            }
            lower[i * order + j] = i == j ? sqrt(rest) : rest / lower[j * order + j];
        }
    }
}

/* The considered errors: L^-1 of their strain, and the errors of the state where strain has them. They are as large as the
   residual leaves them: with P as in flight_settle and strain H, the posterior of standard normal amplitudes has the
   covariance C = (1 + H' P H)^-1 about C H' P r. The mean of their products counts, of which the factor makes independent
   errors. They correct nothing. */
static void set_considered(FlightSolver *solver) {
    Considered *considered = &solver->considered;
    const size_t n = solver->n, count = solver->map->n_considered;
    const double *covariance = solver->solution.state_covariance;
    double by_error[MAX_CONSIDERED][N_STATES], seen[MAX_CONSIDERED], precision[MAX_CONSIDERED * MAX_CONSIDERED];
    double product[MAX_CONSIDERED * MAX_CONSIDERED], mean[MAX_CONSIDERED], lower[MAX_CONSIDERED * MAX_CONSIDERED];
    double *strain = considered->strain;
    memset(considered->part, 0, sizeof considered->part);
    memset(considered->shift, 0, sizeof considered->shift);
    set_considered_strain(solver);
    for (size_t i = 0; i < count; i++) {
        for (size_t k = 0; k < N_STATES; k++) {
            by_error[i][k] = lane_dot(n, solver->right + (1 + k) * n, strain + i * n);
        }
        seen[i] = lane_dot(n, strain + i * n, solver->right)
                - quadratic(N_STATES, by_error[i], covariance, solver->gradient);
        for (size_t j = 0; j <= i; j++) {
            const double both = lane_dot(n, strain + i * n, strain + j * n)
                              - quadratic(N_STATES, by_error[i], covariance, by_error[j]);
            precision[i * count + j] = precision[j * count + i] = i != j ? both : 1.0 + (both > 0.0 ? both : 0.0);
        }
    }
    invert_small(count, precision, product);
    for (size_t i = 0; i < count; i++) {
        mean[i] = 0.0;
        for (size_t j = 0; j < count; j++) {
            mean[i] += product[i * count + j] * seen[j];
        }
    }
    for (size_t i = 0; i < count; i++) {
        for (size_t j = 0; j < count; j++) {
            product[i * count + j] += mean[i] * mean[j];
        }
    }
    factor_small(count, product, lower);
    for (size_t j = 0; j < count; j++) { /* combination j has what `lower` says of the errors from j on */
        considered->part[j] = solver->map->considered.n_rows > 0 ? lower[j] : 0.0;
        for (size_t g = 0; g < n; g++) {
            double sum = 0.0;
            for (size_t i = j; i < count; i++) {
                sum += lower[i * count + j] * strain[i * n + g];
            }
            strain[j * n + g] = sum;
        }
        for (size_t k = 0; k < N_STATES; k++) {
            for (size_t i = j; i < count; i++) {
                considered->shift[j][k] += lower[i * count + j] * along_state(covariance + k * N_STATES, by_error[i]);
            }
        }
    }
}

double flight_considered(const FlightSolver *solver, size_t error, size_t load, const double *turned, double scale,
                         const double *by_state) {
    const Considered *considered = &solver->considered;
    double own = lane_dot(solver->n, turned, considered->strain + error * solver->n);
    if (considered->part[error] != 0.0) {
        own -= considered->part[error] * considered->response.value[solver->n_gauges + load];
    }
    return along_state(by_state, considered->shift[error]) + scale * own;
}

void flight_set_loads(FlightSolver *solver) {
    const FlightMap *map = solver->map;
    const size_t n = solver->n;
    const double square = solver->factor_pressure * solver->factor_pressure;
    set_considered(solver);
    const PressureErrors pressure = flight_pressure_errors(solver);
    Solution *found = &solver->solution;
    double of_load[MAX_CONSIDERED][N_LOADS], of_both[MAX_CONSIDERED][N_LOADS]; /* considered errors, of coefficients, too */
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
        for (size_t e = 0; e < map->n_considered; e++) {
            of_load[e][i] = flight_considered(solver, e, i, turned + i * n, 1.0, by_state[i]);
            of_both[e][i] = flight_considered(solver, e, i, turned + i * n, scale[i], of_coefficient[i]);
        }
    }
    for (size_t i = 0; i < N_LOADS; i++) {
        for (size_t j = 0; j < N_LOADS; j++) {
            const size_t at = i * N_LOADS + j;
            const double remaining =
                square * map->load_covariance[at] - lane_dot(n, turned + i * n, turned + j * n);
            double load = quadratic(N_STATES, by_state[i], found->state_covariance, by_state[j]) + remaining;
            double both = quadratic(N_STATES, of_coefficient[i], found->state_covariance, of_coefficient[j])
                        + scale[i] * remaining * scale[j];
            for (size_t e = 0; e < map->n_considered; e++) {
                load += of_load[e][i] * of_load[e][j];
                both += of_both[e][i] * of_both[e][j];
            }
            found->load_covariance[at] = load;
            found->coefficient_covariance[at] = pressure.wider * both;
        }
    }
}
