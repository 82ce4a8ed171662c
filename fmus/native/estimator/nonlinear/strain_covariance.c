#include "strain_covariance.h"

#include "../numerics/wide.h"

void flight_proportional_errors(FlightSolver *solver, double *own) {
    const FlightMap *map = solver->map;
    const size_t n = solver->n, n_gauges = solver->n_gauges;
    const double pressure = solver->response.pressure, square = pressure * pressure;
    const double *strain = solver->response.value, *loads = strain + n_gauges;
    double c[1 + N_LOADS] = {1.0}, pair[N_PAIRS];
    for (size_t i = 0; i < N_LOADS; i++) {
        const double reference = i < 3 ? map->reference_area : map->reference_area * map->reference_length;
        c[1 + i] = loads[i] / (pressure * reference);
    }
    for (size_t a = 0, k = 0; a <= N_LOADS; a++) {
        for (size_t b = a; b <= N_LOADS; b++) {
            pair[k++] = c[a] * c[b];
        }
    }
    memset(own, 0, n * sizeof *own);
    for (size_t k = 0; k < N_PAIRS; k++) {
        for (size_t g = 0; g < n_gauges; g++) {
            own[g] += pair[k] * map->gauge_error_product[k * n_gauges + g];
        }
    }
    for (size_t g = 0; g < n_gauges; g++) {
        const double gain = map->gain_std[g] * strain[g];
        own[g] = square * (own[g] > 0.0 ? own[g] : 0.0) + gain * gain;
        solver->columns[map->n_common * n + g] = map->common_gain[g] * strain[g];
    }
    for (size_t t = 0; t < map->n_common; t++) {
        double *column = solver->columns + t * n;
        memset(column, 0, n * sizeof *column);
        for (size_t a = 0; a <= N_LOADS; a++) {
            const double *error = map->common_error + (t * (1 + N_LOADS) + a) * n_gauges;
            const double factor = pressure * c[a];
            for (size_t g = 0; g < n_gauges; g++) {
                column[g] += factor * error[g];
            }
        }
    }
}

/* On and below the diagonal, with whole lanes. */
EVERYWHERE void add_covariance(size_t n, size_t n_columns, double square, const double *restrict fixed,
                               const double *restrict scaled, const double *restrict columns, double *restrict out) {
    for (size_t j = 0; j < n; j++) {
        for (size_t i = j / LANES * LANES; i < n; i += LANES) {
            const double *restrict base = fixed + j * n + i, *restrict more = scaled + j * n + i;
            double sum[LANES];
            for (size_t r = 0; r < LANES; r++) {
                sum[r] = base[r] + square * more[r];
            }
            for (size_t t = 0; t < n_columns; t++) {
                const double *restrict column = columns + t * n + i;
                const double factor = columns[t * n + j];
                for (size_t r = 0; r < LANES; r++) {
                    sum[r] += factor * column[r];
                }
            }
            memcpy(out + j * n + i, sum, sizeof sum);
        }
    }
}

#if HAS_AVX2
AVX2 static void add_covariance_avx2(size_t n, size_t n_columns, double square, const double *fixed,
                                     const double *scaled, const double *columns, double *out) {
    add_covariance(n, n_columns, square, fixed, scaled, columns, out);
}
#endif

void flight_strain_covariance(FlightSolver *solver) {
    const size_t n = solver->n;
    const double square = solver->response.pressure * solver->response.pressure;
    double *own = solver->squares;
    flight_proportional_errors(solver, own);
    CHOSEN(solver->wide, add_covariance)(n, solver->map->n_common + 1, square, solver->gauge_covariance,
                                         solver->scaled_covariance, solver->columns, solver->factor);
    for (size_t g = 0; g < solver->n_gauges; g++) {
        solver->factor[g * n + g] += own[g];
    }
}
