#include "flight_tangent.h"

#include <math.h>
#include <string.h>

#include "../../core/elementary.h"
#include "../numerics/cholesky.h"

/* Standard deviations that the next iteration may still move the state by: LARGEST_REMAINDER of derivative.py. */
#define LARGEST_REMAINDER 0.1

static double *taken(double **doubles, size_t count) {
    double *array = *doubles;
    *doubles += count;
    return array;
}

size_t tangents_doubles(const FlightMap *map, const TableMap *widest, size_t n_gauges) {
    return curvature_doubles(widest) + (2 * N_WEIGHTED + 1 + map->n_common + 1) * in_lanes(n_gauges);
}

void tangents_arrays(const FlightSolver *solver, const FlightTables *widest, Tangents *tangents, double **doubles) {
    curvature_arrays(widest, &tangents->curvature, doubles);
    tangents->weighted = taken(doubles, N_WEIGHTED * solver->n);
    tangents->scaled = taken(doubles, N_WEIGHTED * solver->n);
    tangents->own = taken(doubles, solver->n);
    tangents->columns = taken(doubles, (solver->map->n_common + 1) * solver->n);
}

/* w, and the products that L^-1 gives before it is w. */
static void set_weighted(const FlightSolver *solver, Tangents *tangents) {
    const size_t n = solver->n;
    const double *right = solver->right;
    double *weighted = tangents->weighted, *of_loads = weighted + N_RIGHT * n;
    memcpy(weighted, right, N_RIGHT * n * sizeof *weighted);
    flight_turn(solver, solver->map->load_strain_covariance, N_LOADS, of_loads);
    for (size_t i = 0; i < N_WEIGHTED; i++) {
        for (size_t k = 0; k < N_STATES; k++) {
            tangents->with_jacobian[i][k] = lane_dot(n, weighted + i * n, right + (1 + k) * n);
        }
    }
    for (size_t i = 0; i < N_LOADS; i++) {
        tangents->with_residual[i] = lane_dot(n, of_loads + i * n, right);
        for (size_t j = 0; j < N_LOADS; j++) {
            tangents->with_load[i][j] = lane_dot(n, of_loads + i * n, of_loads + j * n);
        }
    }
    solve_upper(solver->wide, n, solver->factor, N_WEIGHTED, weighted);
}

static void set_curvature(const FlightSolver *solver, Tangents *tangents) {
    flight_curvature(&solver->tables, solver->state, &tangents->curvature);
    for (size_t k = 0; k < N_STATES; k++) {
        for (size_t l = k; l < N_STATES; l++) {
            const double *bend = second_derivative(&tangents->curvature, solver->response.jacobian, k, l);
            for (size_t i = 0; i < N_WEIGHTED; i++) {
                tangents->with_curvature[i][k][l] = tangents->with_curvature[i][l][k] =
                    gauge_dot(solver, tangents->weighted + i * solver->n, bend);
            }
        }
    }
}

void tangents_proportional(const FlightSolver *solver, Tangents *tangents, size_t l) {
    const FlightMap *map = solver->map;
    const size_t n = solver->n, n_gauges = solver->n_gauges;
    const double pressure = solver->response.pressure, growth = l == STATE_PRESSURE ? 1.0 : 0.0;
    const double *strain = solver->response.value, *slope = solver->response.jacobian[l];
    double c[1 + N_LOADS] = {1.0}, d_c[1 + N_LOADS] = {0.0};
    for (size_t i = 0; i < N_LOADS; i++) {
        const double reference = i < 3 ? map->reference_area : map->reference_area * map->reference_length;
        c[1 + i] = strain[n_gauges + i] / (pressure * reference);
        d_c[1 + i] = slope[n_gauges + i] / (pressure * reference) - growth * c[1 + i];
    }
    for (size_t g = 0; g < n_gauges; g++) {
        double sum = 0.0, d_sum = 0.0;
        for (size_t a = 0, k = 0; a <= N_LOADS; a++) {
            for (size_t b = a; b <= N_LOADS; b++, k++) {
                const double product = map->gauge_error_product[k * n_gauges + g];
                sum += c[a] * c[b] * product;
                d_sum += (d_c[a] * c[b] + c[a] * d_c[b]) * product;
            }
        }
        tangents->own[g] = (sum > 0.0 ? pressure * pressure * (2.0 * growth * sum + d_sum) : 0.0)
                         + 2.0 * map->gain_std[g] * map->gain_std[g] * strain[g] * slope[g];
        tangents->columns[map->n_common * n + g] = map->common_gain[g] * slope[g];
    }
    for (size_t t = 0; t < map->n_common; t++) {
        for (size_t g = 0; g < n_gauges; g++) {
            double sum = 0.0;
            for (size_t a = 0; a <= N_LOADS; a++) {
                sum += (growth * c[a] + d_c[a]) * map->common_error[(t * (1 + N_LOADS) + a) * n_gauges + g];
            }
            tangents->columns[t * n + g] = pressure * sum;
        }
    }
}

/* w_i' dS w_j by the state l, where S = fixed + p^2 scaled + columns columns' + diagonal. */
static void set_covariance(const FlightSolver *solver, Tangents *tangents, size_t l) {
    const size_t n = solver->n, n_columns = solver->map->n_common + 1;
    const double square = solver->response.pressure * solver->response.pressure;
    const double *columns = solver->columns;
    double(*found)[N_WEIGHTED] = tangents->with_covariance[l];
    tangents_proportional(solver, tangents, l);
    for (size_t i = 0; i < N_WEIGHTED; i++) {
        const double *x = tangents->weighted + i * n;
        for (size_t j = 0; j <= i; j++) {
            const double *y = tangents->weighted + j * n;
            double sum = 0.0;
            for (size_t g = 0; g < solver->n_gauges; g++) {
                sum += tangents->own[g] * x[g] * y[g];
            }
            if (l == STATE_PRESSURE) {
                sum += 2.0 * square * gauge_dot(solver, x, tangents->scaled + j * n);
            }
            found[i][j] = sum;
        }
    }
    for (size_t t = 0; t < n_columns; t++) {
        double of_column[N_WEIGHTED], of_change[N_WEIGHTED];
        for (size_t i = 0; i < N_WEIGHTED; i++) {
            of_column[i] = gauge_dot(solver, tangents->weighted + i * n, columns + t * n);
            of_change[i] = gauge_dot(solver, tangents->weighted + i * n, tangents->columns + t * n);
        }
        for (size_t i = 0; i < N_WEIGHTED; i++) {
            for (size_t j = 0; j <= i; j++) {
                found[i][j] += of_column[i] * of_change[j] + of_change[i] * of_column[j];
            }
        }
    }
    for (size_t i = 0; i < N_WEIGHTED; i++) {
        for (size_t j = 0; j < i; j++) {
            found[j][i] = found[i][j];
        }
    }
}

static void set_all_covariances(FlightSolver *solver, Tangents *tangents) {
    const size_t n = solver->n;
    for (size_t j = 0; j < N_WEIGHTED; j++) {
        for (size_t g = 0; g < n; g++) { /* symmetric: its rows are its columns */
            tangents->scaled[j * n + g] = lane_dot(n, solver->scaled_covariance + g * n, tangents->weighted + j * n);
        }
    }
    flight_proportional_errors(solver, tangents->own);
    for (size_t l = 0; l < N_STATES; l++) {
        set_covariance(solver, tangents, l);
    }
}

double tangents_row_slope(const FlightSolver *solver) {
    const double mach = solver->state[STATE_MACH];
    return mach > MIN_MACH ? -2.0 / (mach * mach) : 0.0;
}

static void set_by_state(const FlightSolver *solver, Tangents *tangents) {
    for (size_t k = 0; k < N_STATES; k++) {
        for (size_t l = 0; l < N_STATES; l++) {
            tangents->by_state[k][l] = tangents->with_jacobian[1 + k][l] + tangents->with_covariance[l][1 + k][0]
                                     - tangents->with_curvature[0][k][l];
        }
    }
    for (size_t m = 0; m < N_MEASURED; m++) {
        double row[N_STATES];
        flight_measurement_row(solver->log_mach_slope, m, row);
        for (size_t k = 0; k < N_STATES; k++) {
            for (size_t l = 0; l < N_STATES; l++) {
                tangents->by_state[k][l] += solver->sample.precision[m] * row[k] * row[l];
            }
        }
    }
    tangents->by_state[STATE_MACH][STATE_MACH] -=
        solver->sample.precision[2] * solver->innovation[2] * tangents_row_slope(solver);
}

void tangents_prepare(FlightSolver *solver, Tangents *tangents) {
    tangents->outdated = 0;
    const double left = quadratic(N_STATES, solver->gradient, solver->solution.state_covariance, solver->gradient);
    tangents->ended = left <= LARGEST_REMAINDER * LARGEST_REMAINDER;
    set_weighted(solver, tangents);
    set_curvature(solver, tangents);
    set_all_covariances(solver, tangents);
    set_by_state(solver, tangents);
}
