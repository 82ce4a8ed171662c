/* What noise that is independent from sample to sample adds to the errors of the nonlinear estimator: nu of the
   filter.

   An output o(d, z) of the solution has, to first order, the response do/dd (n) to strain and do/dz (3) to
   navigation. Its rows here are in standard deviations of the noise,

       rows = [ do/dd diag(nu_g)^(1/2),  do/dz diag(b sigma_m^2)^(1/2) ],     nu = rows rows',

   b (of_air) is the part of the variance of air data that is noise. The state responds by dx/dd = H^-1 J' S^-1 and
   dx/dz_m = H^-1 H_m' / sigma_m^2, where `right` holds L^-1 J. A load f = L(x) + K r has df/dd = (J_L - K J) dx/dd +
   K, df/dz = (J_L - K J) dx/dz; a coefficient scale df - C d ln q/dx dx, widened as q_inf is (flight_loads.c).
   Covariance of two outputs is the product of their rows, which the transfer of moments needs.
   docs/explanation/filter.md, "Model". */

#include "flight_noise.h"

#include <math.h>

#include "../numerics/cholesky.h"
#include "flight_loads.h"
#include "flight_solve.h"

size_t flight_noise_row(size_t n_gauges) {
    return in_lanes(n_gauges) + LANES;
}

/* S^-1 of what L has whitened (L'^-1 of it), times sqrt(nu_g) of each gauge. */
static void turn_to_noise(const FlightSolver *solver, const double *gauge_noise, size_t count, double *whitened) {
    const size_t n = solver->n;
    solve_upper(solver->wide, n, solver->factor, count, whitened);
    for (size_t k = 0; k < count; k++) {
        for (size_t g = 0; g < n; g++) {
            whitened[k * n + g] *= g < solver->n_gauges ? sqrt(gauge_noise[g]) : 0.0;
        }
    }
}

/* out = factor' rows of the state, plus what strain adds directly (n); NULL for nothing. */
static void combine_rows(const FlightSolver *solver, const double *factor, const double *rows, const double *direct,
                         double *out) {
    const size_t row = flight_noise_row(solver->n_gauges);
    for (size_t g = 0; g < row; g++) {
        out[g] = direct != NULL && g < solver->n ? direct[g] : 0.0;
    }
    for (size_t k = 0; k < N_STATES; k++) {
        for (size_t g = 0; g < row; g++) {
            out[g] += factor[k] * rows[k * row + g];
        }
    }
}

/* Rows of the state: H^-1 J' S^-1 by gauges, H^-1 H_m' / sigma_m^2 sqrt(b) sigma_m by navigation. */
static void set_state_rows(const FlightSolver *solver, const double *gauge_noise, double of_air, double *rows,
                           double *scratch) {
    const size_t n = solver->n, row = flight_noise_row(solver->n_gauges);
    const double *errors = solver->solution.state_covariance;
    memcpy(scratch, solver->right + n, N_STATES * n * sizeof *scratch);
    turn_to_noise(solver, gauge_noise, N_STATES, scratch);
    memset(rows, 0, N_STATES * row * sizeof *rows);
    for (size_t k = 0; k < N_STATES; k++) {
        for (size_t j = 0; j < N_STATES; j++) {
            for (size_t g = 0; g < n; g++) {
                rows[k * row + g] += errors[k * N_STATES + j] * scratch[j * n + g];
            }
        }
    }
    for (size_t m = 0; m < N_NAVIGATION; m++) {
        const double size = sqrt(of_air * solver->sample.precision[m]);
        double read[N_STATES];
        flight_measurement_row(solver->log_mach_slope, m, read);
        for (size_t k = 0; k < N_STATES; k++) {
            for (size_t j = 0; j < N_STATES; j++) {
                rows[k * row + n + m] += errors[k * N_STATES + j] * read[j] * size;
            }
        }
    }
}

/* wider (scale df - C d ln q/dx dx), from the row of the load. */
static void set_coefficient_row(const FlightSolver *solver, const PressureErrors *pressure, double scale, double coefficient,
                                const double *rows, const double *of_load, double *out) {
    const size_t row = flight_noise_row(solver->n_gauges);
    const double wider = sqrt(pressure->wider);
    combine_rows(solver, pressure->by_state, rows, NULL, out);
    for (size_t g = 0; g < row; g++) {
        out[g] = wider * (scale * of_load[g] - coefficient * out[g]);
    }
}

void flight_noise_rows(const FlightSolver *solver, const double *gauge_noise, double of_air, double *rows) {
    const FlightMap *map = solver->map;
    const size_t n = solver->n, row = flight_noise_row(solver->n_gauges);
    const PressureErrors pressure = flight_pressure_errors(solver);
    double *loads = rows + N_STATES * row, *coefficients = loads + N_LOADS * row, *scratch = coefficients + N_LOADS * row;
    double by_state[N_LOADS][N_STATES];
    set_state_rows(solver, gauge_noise, of_air, rows, scratch);
    flight_turn(solver, map->load_strain_covariance, N_LOADS, scratch);
    for (size_t i = 0; i < N_LOADS; i++) {
        flight_corrected(solver, solver->right, &solver->response, solver->n_gauges + i, scratch + i * n, by_state[i]);
    }
    turn_to_noise(solver, gauge_noise, N_LOADS, scratch);
    for (size_t i = 0; i < N_LOADS; i++) {
        const double reference = i < 3 ? map->reference_area : map->reference_area * map->reference_length;
        combine_rows(solver, by_state[i], rows, scratch + i * n, loads + i * row);
        set_coefficient_row(solver, &pressure, 1.0 / (pressure.dynamic * reference), solver->solution.coefficients[i], rows,
                            loads + i * row, coefficients + i * row);
    }
}

static double square_of(size_t count, const double *x) {
    double sum = 0.0;
    for (size_t k = 0; k < count; k++) {
        sum += x[k] * x[k];
    }
    return sum;
}

/* The same of loads in addition to the five, one row at a time: only their variances are needed. */
void flight_other_noise(FlightOtherLoads *other_loads, const FlightSolver *solver, const Inputs *inputs,
                        const OtherLoads *out, const double *gauge_noise, const double *rows, double *scratch,
                        double *of_loads, double *of_coefficients) {
    const FlightMap *map = solver->map;
    const size_t n = solver->n, row = flight_noise_row(solver->n_gauges), m = other_loads->map.tables.n_rows;
    const PressureErrors pressure = flight_pressure_errors(solver);
    double *of_load = scratch, *of_coefficient = scratch + row;
    for (size_t j = 0; j < m; j++) {
        const int is_moment = out->map.is_moment[j] > 0.0;
        const double reference = map->reference_area * (is_moment ? map->reference_length : 1.0);
        const double own =
            scalar_input(inputs, REFERENCE_AREA) * (is_moment ? scalar_input(inputs, REFERENCE_LENGTH) : 1.0);
        const double scale = 1.0 / (pressure.dynamic * reference), turn = reference / own;
        double by_state[N_STATES], *turned = other_loads->turned + j * n;
        flight_corrected(solver, solver->right, &other_loads->response, j, turned, by_state);
        turn_to_noise(solver, gauge_noise, 1, turned);
        combine_rows(solver, by_state, rows, turned, of_load);
        set_coefficient_row(solver, &pressure, scale, scale * out->value[OTHER_LOADS][j], rows, of_load, of_coefficient);
        of_loads[j] = square_of(row, of_load);
        of_coefficients[j] = turn * turn * square_of(row, of_coefficient);
    }
}
