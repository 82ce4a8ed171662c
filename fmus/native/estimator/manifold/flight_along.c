/* The change of a solution along a change of its sample, from what flight_tangent.c has prepared. */

#include <math.h>
#include <string.h>

#include "../../core/elementary.h"
#include "flight_tangent.h"

/* x = A^-1 x by elimination with row interchanges. */
static void eliminate(double a[N_STATES][N_STATES], double x[N_STATES]) {
    for (size_t k = 0; k < N_STATES; k++) {
        size_t best = k;
        for (size_t i = k + 1; i < N_STATES; i++) {
            best = fabs(a[i][k]) > fabs(a[best][k]) ? i : best;
        }
        for (size_t j = 0; j < N_STATES; j++) {
            const double kept = a[k][j];
            a[k][j] = a[best][j];
            a[best][j] = kept;
        }
        const double kept = x[k];
        x[k] = x[best];
        x[best] = kept;
        for (size_t i = k + 1; i < N_STATES; i++) {
            const double factor = a[i][k] / a[k][k];
            for (size_t j = k; j < N_STATES; j++) {
                a[i][j] -= factor * a[k][j];
            }
            x[i] -= factor * x[k];
        }
    }
    for (size_t k = N_STATES; k-- > 0;) {
        for (size_t j = k + 1; j < N_STATES; j++) {
            x[k] -= a[k][j] * x[j];
        }
        x[k] /= a[k][k];
    }
}

/* Scalings of states differ: each row and column of -F_x is taken over the root of the Hessian's diagonal. */
static void derive_state(const FlightSolver *solver, const Tangents *tangents, const SampleChange *sample,
                         const double *of_strain, double state[N_STATES]) {
    double a[N_STATES][N_STATES], size[N_STATES];
    memcpy(state, of_strain + 1, N_STATES * sizeof *state);
    for (size_t m = 0; m < N_MEASURED; m++) {
        double row[N_STATES];
        flight_measurement_row(solver->log_mach_slope, m, row);
        const double push =
            sample->precision[m] * solver->innovation[m] + solver->sample.precision[m] * sample->value[m];
        for (size_t k = 0; k < N_STATES; k++) {
            state[k] += row[k] * push;
        }
    }
    for (size_t k = 0; k < N_STATES; k++) {
        size[k] = 1.0 / sqrt(solver->hessian[k * N_STATES + k]);
    }
    for (size_t k = 0; k < N_STATES; k++) {
        for (size_t l = 0; l < N_STATES; l++) {
            a[k][l] = size[k] * tangents->by_state[k][l] * size[l];
        }
        state[k] *= size[k];
    }
    eliminate(a, state);
    for (size_t k = 0; k < N_STATES; k++) {
        state[k] *= size[k];
    }
}

/* What changes along dx: w' dS w, w' dJ and, with the strain's own change, w' dr. */
typedef struct {
    double covariance[N_WEIGHTED][N_WEIGHTED], jacobian[N_WEIGHTED][N_STATES], residual[N_WEIGHTED];
} Along;

static void set_along(const Tangents *tangents, const double *of_strain, const double *state, Along *along) {
    for (size_t i = 0; i < N_WEIGHTED; i++) {
        along->residual[i] = of_strain[i];
        for (size_t l = 0; l < N_STATES; l++) {
            along->residual[i] -= tangents->with_jacobian[i][l] * state[l];
        }
        for (size_t k = 0; k < N_STATES; k++) {
            along->jacobian[i][k] = 0.0;
            for (size_t l = 0; l < N_STATES; l++) {
                along->jacobian[i][k] += tangents->with_curvature[i][k][l] * state[l];
            }
        }
        for (size_t j = 0; j < N_WEIGHTED; j++) {
            along->covariance[i][j] = 0.0;
            for (size_t l = 0; l < N_STATES; l++) {
                along->covariance[i][j] += tangents->with_covariance[l][i][j] * state[l];
            }
        }
    }
}

/* Chi-square and the covariance of the state: dE = -E dH E. */
static void derive_fit(const FlightSolver *solver, const SampleChange *sample, const Along *along,
                       SolutionChange *change) {
    const double *errors = solver->solution.state_covariance;
    double hessian[N_STATES * N_STATES], half[N_STATES * N_STATES];
    change->chi_square = 2.0 * along->residual[0] - along->covariance[0][0];
    for (size_t k = 0; k < N_STATES; k++) {
        for (size_t l = 0; l < N_STATES; l++) {
            hessian[k * N_STATES + l] =
                along->jacobian[1 + k][l] + along->jacobian[1 + l][k] - along->covariance[1 + k][1 + l];
        }
    }
    for (size_t m = 0; m < N_MEASURED; m++) {
        const double precision = solver->sample.precision[m], innovation = solver->innovation[m];
        double row[N_STATES], d_row[N_STATES] = {0.0}, d_innovation = sample->value[m];
        flight_measurement_row(solver->log_mach_slope, m, row);
        d_row[STATE_MACH] = m == 2 ? tangents_row_slope(solver) * change->state[STATE_MACH] : 0.0;
        for (size_t k = 0; k < N_STATES; k++) {
            d_innovation -= row[k] * change->state[k];
            for (size_t l = 0; l < N_STATES; l++) {
                hessian[k * N_STATES + l] +=
                    sample->precision[m] * row[k] * row[l] + precision * (d_row[k] * row[l] + row[k] * d_row[l]);
            }
        }
        change->chi_square += sample->precision[m] * innovation * innovation + 2.0 * precision * innovation * d_innovation;
    }
    for (size_t i = 0; i < N_STATES; i++) {
        for (size_t j = 0; j < N_STATES; j++) {
            half[i * N_STATES + j] = 0.0;
            for (size_t k = 0; k < N_STATES; k++) {
                half[i * N_STATES + j] -= errors[i * N_STATES + k] * hessian[k * N_STATES + j];
            }
        }
    }
    for (size_t i = 0; i < N_STATES; i++) {
        for (size_t j = 0; j < N_STATES; j++) {
            change->state_covariance[i * N_STATES + j] = 0.0;
            for (size_t k = 0; k < N_STATES; k++) {
                change->state_covariance[i * N_STATES + j] +=
                    half[i * N_STATES + k] * errors[k * N_STATES + j];
            }
        }
    }
}

/* x' E y of rows by the state, and its change, with those of the rows. */
static double derive_quadratic(const FlightSolver *solver, const SolutionChange *change, const double *x,
                               const double *y, const double *d_x, const double *d_y) {
    const double *errors = solver->solution.state_covariance;
    return quadratic(N_STATES, d_x, errors, y) + quadratic(N_STATES, x, errors, d_y)
         + quadratic(N_STATES, x, change->state_covariance, y);
}

/* Rows by the state of a load that strain corrects and of its coefficient, and their changes. */
typedef struct {
    double of_load[N_STATES], d_load[N_STATES], of_coefficient[N_STATES], d_coefficient[N_STATES];
    double scale, d_scale;
} LoadRows;

static void set_rows(const FlightSolver *solver, const Tangents *tangents, const Along *along, size_t i,
                     const PressureErrors *pressure, const double *d_by_state, LoadRows *rows, SolutionChange *change) {
    const FlightMap *map = solver->map;
    const size_t w = N_RIGHT + i, row = solver->n_gauges + i;
    const double growth = 2.0 * change->state[STATE_PRESSURE];
    const double reference = i < 3 ? map->reference_area : map->reference_area * map->reference_length;
    const double coefficient = solver->solution.coefficients[i];
    double d_log = 0.0;
    change->loads[i] = growth * tangents->with_residual[i] - along->covariance[w][0] + along->residual[w];
    for (size_t k = 0; k < N_STATES; k++) {
        const double turned = tangents->with_jacobian[w][k];
        change->loads[i] += solver->response.jacobian[k][row] * change->state[k];
        d_log += pressure->by_state[k] * change->state[k];
        rows->of_load[k] = solver->response.jacobian[k][row] - turned;
        rows->d_load[k] = -(growth * turned - along->covariance[w][1 + k] + along->jacobian[w][k]);
        for (size_t l = 0; l < N_STATES; l++) {
            rows->d_load[k] +=
                second_derivative(&tangents->curvature, solver->response.jacobian, k, l)[row] * change->state[l];
        }
    }
    rows->scale = 1.0 / (pressure->dynamic * reference);
    rows->d_scale = -rows->scale * d_log;
    change->coefficients[i] = rows->scale * change->loads[i] + rows->d_scale * solver->solution.loads[i];
    for (size_t k = 0; k < N_STATES; k++) {
        rows->of_coefficient[k] = rows->scale * rows->of_load[k] - coefficient * pressure->by_state[k];
        rows->d_coefficient[k] = rows->d_scale * rows->of_load[k] + rows->scale * rows->d_load[k]
                               - change->coefficients[i] * pressure->by_state[k] - coefficient * d_by_state[k];
    }
}

/* Change of the derivative of ln q_inf by the state. */
static void derive_row(const FlightSolver *solver, const SolutionChange *change, double d_by_state[N_STATES]) {
    const double mach = solver->state[STATE_MACH];
    memset(d_by_state, 0, N_STATES * sizeof *d_by_state);
    d_by_state[STATE_MACH] = -2.0 / (mach * mach) * change->state[STATE_MACH];
}

/* wider = (lognormal(s) / s)^2 of the deviation s of ln q_inf. */
double tangents_wider(const FlightSolver *solver, const PressureErrors *pressure, const SolutionChange *change) {
    const double *row = pressure->by_state;
    double d_by_state[N_STATES];
    derive_row(solver, change, d_by_state);
    const double variance = quadratic(N_STATES, row, solver->solution.state_covariance, row), s = sqrt(variance);
    const double d_s = derive_quadratic(solver, change, row, row, d_by_state, d_by_state) / (2.0 * s);
    const double of_log = lognormal_deviation(s), slope = exponential(3.0 * s);
    return 2.0 * (of_log / s) * (slope - of_log / s) / s * d_s;
}

static void derive_loads(const FlightSolver *solver, const Tangents *tangents, const Along *along,
                         SolutionChange *change) {
    const FlightMap *map = solver->map;
    const double square = solver->factor_pressure * solver->factor_pressure;
    const double growth = 2.0 * change->state[STATE_PRESSURE];
    const PressureErrors pressure = flight_pressure_errors(solver);
    double d_by_state[N_STATES];
    derive_row(solver, change, d_by_state);
    const double d_wider = tangents_wider(solver, &pressure, change);
    const double *errors = solver->solution.state_covariance;
    LoadRows rows[N_LOADS];
    for (size_t i = 0; i < N_LOADS; i++) {
        set_rows(solver, tangents, along, i, &pressure, d_by_state, rows + i, change);
    }
    for (size_t i = 0; i < N_LOADS; i++) {
        for (size_t j = 0; j < N_LOADS; j++) {
            const size_t at = i * N_LOADS + j;
            const LoadRows *a = rows + i, *b = rows + j;
            const double turned = tangents->with_load[i][j];
            const double remaining = square * map->load_covariance[at] - turned;
            const double d_remaining = growth * square * map->load_covariance[at]
                                     - (2.0 * growth * turned - along->covariance[N_RIGHT + i][N_RIGHT + j]);
            const double both = quadratic(N_STATES, a->of_coefficient, errors, b->of_coefficient)
                              + a->scale * remaining * b->scale;
            change->load_covariance[at] =
                derive_quadratic(solver, change, a->of_load, b->of_load, a->d_load, b->d_load) + d_remaining;
            const double d_both = derive_quadratic(solver, change, a->of_coefficient, b->of_coefficient,
                                                   a->d_coefficient, b->d_coefficient)
                                + (a->d_scale * b->scale + a->scale * b->d_scale) * remaining
                                + a->scale * d_remaining * b->scale;
            change->coefficient_covariance[at] = d_wider * both + pressure.wider * d_both;
        }
    }
}

void tangents_along(const FlightSolver *solver, const Tangents *tangents, const SampleChange *sample,
                    SolutionChange *change) {
    double of_strain[N_WEIGHTED];
    Along along;
    for (size_t i = 0; i < N_WEIGHTED; i++) {
        of_strain[i] = gauge_dot(solver, tangents->weighted + i * solver->n, sample->strain);
    }
    derive_state(solver, tangents, sample, of_strain, change->state);
    set_along(tangents, of_strain, change->state, &along);
    derive_fit(solver, sample, &along, change);
    derive_loads(solver, tangents, &along, change);
}
