/* Derivatives of rolling moment and section loads over the flight state, as flight_along.c has them of the five loads. */

#include <string.h>

#include "../numerics/cholesky.h"
#include "../numerics/dual.h"
#include "flight_derivative.h"

#define PRODUCTS (sizeof(LoadProducts) / sizeof(double)) /* all of it doubles */

size_t further_tangents_doubles(const TableMap *widest, size_t n_gauges) {
    const size_t m = widest->n_rows;
    return m == 0 ? 0 : curvature_doubles(widest) + m * (in_lanes(n_gauges) + PRODUCTS);
}

void further_tangents_arrays(Flight *flight, const FlightTables *widest, size_t n_gauges, double **doubles) {
    FurtherTangents *tangents = &flight->further_tangents;
    const size_t m = flight->further.map.tables.n_rows;
    if (m > 0) {
        curvature_arrays(widest, &tangents->curvature, doubles);
        tangents->weighted = *doubles;
        tangents->products = (LoadProducts *)(void *)(tangents->weighted + m * in_lanes(n_gauges));
        *doubles += m * (in_lanes(n_gauges) + PRODUCTS);
    }
}

/* x' D y of the variances of each gauge, and of what scales, with `scaled` the scaled covariance times y. */
static double with_gauges(const Flight *flight, size_t l, const double *x, const double *y, const double *scaled) {
    const FlightSolver *solver = &flight->solver;
    const double *own = flight->tangents.own;
    double sum = 0.0;
    for (size_t g = 0; g < solver->n_gauges; g++) {
        sum += own[g] * x[g] * y[g];
    }
    if (l == STATE_PRESSURE) {
        sum += 2.0 * solver->response.pressure * solver->response.pressure * gauge_dot(solver, x, scaled);
    }
    return sum;
}

/* The same of column t that all gauges have in common, added to all loads. */
static void add_column(Flight *flight, size_t l, size_t t) {
    const FlightSolver *solver = &flight->solver;
    const size_t n = solver->n;
    const double *column = solver->columns + t * n, *change = flight->tangents.columns + t * n;
    double of_column[N_RIGHT], of_change[N_RIGHT];
    for (size_t i = 0; i < N_RIGHT; i++) {
        of_column[i] = gauge_dot(solver, flight->tangents.weighted + i * n, column);
        of_change[i] = gauge_dot(solver, flight->tangents.weighted + i * n, change);
    }
    for (size_t j = 0; j < flight->further.map.tables.n_rows; j++) {
        const double *x = flight->further_tangents.weighted + j * n;
        const double own_column = gauge_dot(solver, x, column), own_change = gauge_dot(solver, x, change);
        double *found = flight->further_tangents.products[j].with_covariance[l];
        for (size_t i = 0; i < N_RIGHT; i++) {
            found[i] += own_column * of_change[i] + own_change * of_column[i];
        }
        found[N_RIGHT] += 2.0 * own_column * own_change;
    }
}

static void set_covariances(Flight *flight) {
    FlightSolver *solver = &flight->solver;
    Tangents *tangents = &flight->tangents;
    const size_t n = solver->n, m = flight->further.map.tables.n_rows;
    double *own_scaled = solver->squares;
    flight_proportional_errors(solver, tangents->own);
    for (size_t l = 0; l < N_STATES; l++) {
        tangents_proportional(solver, tangents, l);
        for (size_t j = 0; j < m; j++) {
            const double *x = flight->further_tangents.weighted + j * n;
            double *found = flight->further_tangents.products[j].with_covariance[l];
            for (size_t i = 0; i < N_RIGHT; i++) {
                found[i] = with_gauges(flight, l, x, tangents->weighted + i * n, tangents->scaled + i * n);
            }
            for (size_t g = 0; l == STATE_PRESSURE && g < n; g++) {
                own_scaled[g] = lane_dot(n, solver->scaled_covariance + g * n, x);
            }
            found[N_RIGHT] = with_gauges(flight, l, x, x, own_scaled);
        }
        for (size_t t = 0; t <= solver->map->n_common; t++) {
            add_column(flight, l, t);
        }
    }
}

void further_tangents_prepare(Flight *flight) {
    FlightSolver *solver = &flight->solver;
    FlightFurther *further = &flight->further;
    const size_t n = solver->n, m = further->map.tables.n_rows;
    double *weighted = flight->further_tangents.weighted;
    if (m == 0) {
        return;
    }
    flight_response(&further->tables, solver->wide, solver->state, &further->response);
    flight_curvature(&further->tables, solver->state, &flight->further_tangents.curvature);
    flight_turn(solver, further->map.strain_covariance, m, weighted);
    for (size_t j = 0; j < m; j++) {
        LoadProducts *found = flight->further_tangents.products + j;
        found->with_residual = lane_dot(n, weighted + j * n, solver->right);
        found->with_load = lane_dot(n, weighted + j * n, weighted + j * n);
        for (size_t k = 0; k < N_STATES; k++) {
            found->with_jacobian[k] = lane_dot(n, weighted + j * n, solver->right + (1 + k) * n);
        }
    }
    solve_upper(solver->wide, n, solver->factor, m, weighted);
    for (size_t k = 0; k < N_STATES; k++) {
        for (size_t l = 0; l < N_STATES; l++) {
            const double *bend = second_derivative(&flight->tangents.curvature, solver->response.jacobian, k, l);
            for (size_t j = 0; j < m; j++) {
                flight->further_tangents.products[j].with_curvature[k][l] = gauge_dot(solver, weighted + j * n, bend);
            }
        }
    }
    set_covariances(flight);
}

/* A load, its variance but for that of the state, and its derivative by the state. */
typedef struct {
    Dual load, remaining, by_state[N_STATES];
} FurtherChange;

static FurtherChange change_of(const Flight *flight, size_t j, const double *d_strain, const SolutionChange *change) {
    const FlightSolver *solver = &flight->solver;
    const FurtherTangents *tangents = &flight->further_tangents;
    const LoadProducts *found = tangents->products + j;
    const Response *response = &flight->further.response;
    const double growth = 2.0 * change->state[STATE_PRESSURE];
    const double square = solver->factor_pressure * solver->factor_pressure * flight->further.map.variance[j];
    double of_covariance[N_RIGHT + 1] = {0.0};
    FurtherChange out = {.load = dual(response->value[j] + found->with_residual, growth * found->with_residual)};
    out.load.change += gauge_dot(solver, tangents->weighted + j * solver->n, d_strain);
    for (size_t l = 0; l < N_STATES; l++) {
        for (size_t i = 0; i <= N_RIGHT; i++) {
            of_covariance[i] += found->with_covariance[l][i] * change->state[l];
        }
        out.load.change += (response->jacobian[l][j] - found->with_jacobian[l]) * change->state[l];
    }
    out.load.change -= of_covariance[0];
    for (size_t k = 0; k < N_STATES; k++) {
        double slope = of_covariance[1 + k] - growth * found->with_jacobian[k];
        for (size_t l = 0; l < N_STATES; l++) {
            const double bend = second_derivative(&tangents->curvature, response->jacobian, k, l)[j];
            slope += (bend - found->with_curvature[k][l]) * change->state[l];
        }
        out.by_state[k] = dual(response->jacobian[k][j] - found->with_jacobian[k], slope);
    }
    out.remaining = dual(square - found->with_load,
                         growth * square - (2.0 * growth * found->with_load - of_covariance[N_RIGHT]));
    out.remaining = dual_larger(dual(0.0, 0.0), out.remaining);
    return out;
}

/* Variance of a row by the state, and what remains. */
static Dual variance_of(const FlightSolver *solver, const SolutionChange *change, const Dual *row, Dual remaining) {
    Dual sum = remaining;
    for (size_t i = 0; i < N_STATES; i++) {
        for (size_t j = 0; j < N_STATES; j++) {
            const size_t at = i * N_STATES + j;
            const Dual error = dual(solver->solution.state_covariance[at], change->state_covariance[at]);
            sum = dual_sum(1.0, sum, 1.0, dual_product(dual_product(row[i], error), row[j]));
        }
    }
    return sum;
}

void derive_further(Estimator *e, const double *d_input, const SolutionChange *change, double *d_further) {
    const Flight *flight = &e->flight;
    const FlightSolver *solver = &flight->solver;
    const size_t n_gauges = e->map.n_gauges, m = flight->further.map.tables.n_rows;
    const double *scalar = e->input + n_gauges, *d_scalar = d_input + n_gauges;
    const double mach = solver->state[STATE_MACH];
    const PressureErrors pressure = flight_pressure_errors(solver);
    const Dual wider = dual(pressure.wider, tangents_wider(solver, &pressure, change));
    const Dual area = dual(scalar[REFERENCE_AREA], d_scalar[REFERENCE_AREA]);
    const Dual length = dual(scalar[REFERENCE_LENGTH], d_scalar[REFERENCE_LENGTH]);
    const Dual d_mach = dual(mach, change->state[STATE_MACH]), zero = {0.0, 0.0}, one = {1.0, 0.0};
    const Dual of_log[N_STATES] = {dual_ratio(dual(2.0, 0.0), d_mach), zero, zero, one};
    double d_dynamic = 0.0;
    for (size_t k = 0; k < N_STATES; k++) {
        d_dynamic += pressure.dynamic * pressure.by_state[k] * change->state[k];
    }
    const Dual dynamic = dual(pressure.dynamic, d_dynamic);
    for (size_t j = 0; j < m; j++) {
        const FurtherChange found = change_of(flight, j, d_input, change);
        const int is_moment = e->further.map.is_moment[j] > 0.0;
        const Dual own = is_moment ? dual_product(area, length) : area;
        const Dual scale = dual_ratio(one, dual_product(dynamic, own));
        const Dual coefficient = dual_product(scale, found.load);
        Dual row[N_STATES];
        for (size_t k = 0; k < N_STATES; k++) {
            row[k] = dual_sum(1.0, dual_product(scale, found.by_state[k]), -1.0, dual_product(coefficient, of_log[k]));
        }
        const Dual rest = dual_product(dual_product(scale, scale), found.remaining);
        const Dual variance = variance_of(solver, change, found.by_state, found.remaining);
        const Dual of_both = dual_product(wider, variance_of(solver, change, row, rest));
        d_further[FURTHER_LOADS * m + j] = found.load.change;
        d_further[FURTHER_LOADS_STD * m + j] = dual_root(variance).change;
        d_further[FURTHER_COEFFICIENTS * m + j] = coefficient.change;
        d_further[FURTHER_COEFFICIENTS_STD * m + j] = dual_root(of_both).change;
    }
}
