#include "filter_rows.h"

#include <math.h>

#include "../nonlinear/flight_solve.h"
#include "../numerics/cholesky.h"
#include "../numerics/products.h"

/* Rows that are not in use read nothing, with a noise of 1. */

/* The first row of navigation. */
static double *navigation_rows(const Filter *filter, double *column) {
    return column + filter->gauges;
}

/* c = [1, coefficients of load] at the state of solver->response, with p_inf. */
static void coefficients_at(const FlightSolver *solver, double c[1 + N_LOADS]) {
    const FlightMap *map = solver->map;
    const double *loads = solver->response.value + solver->n_gauges;
    c[0] = 1.0;
    for (size_t i = 0; i < N_LOADS; i++) {
        const double reference = i < 3 ? map->reference_area : map->reference_area * map->reference_length;
        c[1 + i] = loads[i] / (solver->response.pressure * reference);
    }
}

/* `count` terms per p_inf and c, each (1 + N_LOADS, n_gauges), as rows of gauges `row` apart. */
static void follow_loads(const FlightSolver *solver, size_t count, const double *error, double *out, size_t row) {
    const size_t n = solver->n_gauges;
    double c[1 + N_LOADS];
    coefficients_at(solver, c);
    for (size_t a = 0; a <= N_LOADS; a++) {
        c[a] *= solver->response.pressure;
    }
    for (size_t t = 0; t < count; t++) {
        const double *restrict one = error + t * (1 + N_LOADS) * n;
        double *restrict sum = out + t * row;
        for (size_t g = 0; g < n; g++) {
            double all = c[0] * one[g];
            for (size_t a = 1; a <= N_LOADS; a++) {
                all += c[a] * one[a * n + g];
            }
            sum[g] = all;
        }
    }
}

/* Set what is no gauge in use to 0, of `count` rows. */
static void leave_out(const Filter *filter, size_t count, double *rows, size_t row) {
    const Sample *sample = &filter->solver->sample;
    for (size_t g = 0; g < filter->solver->n_gauges; g++) {
        if (!sample->used[g]) {
            for (size_t k = 0; k < count; k++) {
                rows[k * row + g] = 0.0;
            }
        }
    }
}

/* What strain and navigation read of b, c and e, at the state of solver->response. */
static void set_read(Filter *filter) {
    const FlightSolver *solver = filter->solver;
    const FlightMap *flight = solver->map;
    const FilterMap *map = &filter->map;
    const size_t n = solver->n_gauges, rows = filter->rows;
    const double pressure = solver->response.pressure;
    double *seen = filter->read + FIRST_SEEN * rows, *gain = filter->read + filter->first_e * rows;
    double *shared = gain + (1 + flight->n_common) * rows;
    memset(filter->read + N_STATES * rows, 0, (filter->laws.order - N_STATES) * rows * sizeof *filter->read);
    for (size_t k = 0; k < N_NAVIGATION; k++) {
        filter->scale[k] = sqrt(solver->sample.precision[k]);
        if (filter->scale[k] > 0.0) {
            double *own = filter->read + (FIRST_NAVIGATION + k) * rows;
            navigation_rows(filter, own)[k] = sqrt(1.0 - map->white_navigation);
        }
    }
    for (size_t k = 0; k < map->n_seen; k++) {
        for (size_t g = 0; g < n; g++) {
            seen[k * rows + g] = pressure * filter->errors.strain[k * n + g];
        }
    }
    for (size_t g = 0; g < n; g++) {
        gain[g] = flight->common_gain[g] * solver->response.value[g];
    }
    for (size_t k = 0; k < map->n_shared; k++) {
        memcpy(shared + k * rows, map->shared + k * n, n * sizeof *shared);
    }
    follow_loads(solver, flight->n_common, flight->common_error, gain + rows, rows);
    leave_out(filter, filter->n_read - FIRST_SEEN, seen, rows);
}

/* The considered errors, at the state of solver->response. */
static void set_terms(Filter *filter) {
    const FlightSolver *solver = filter->solver;
    const FilterMap *map = &filter->map;
    double *term = filter->term;
    if (solver->map->has_gain_error) {
        for (size_t g = 0; g < solver->n_gauges; g++) {
            term[g] = solver->map->gain_std[g] * solver->response.value[g];
        }
        term += filter->gauges;
    }
    for (size_t k = 0; k < map->n_own; k++, term += filter->gauges) {
        memcpy(term, map->own, solver->n_gauges * sizeof *term);
    }
    follow_loads(solver, map->n_terms, map->of_gauge, term, filter->gauges);
    leave_out(filter, filter->n_terms, filter->term, filter->gauges);
}

/* Rows and columns of gauges that are not in use are those of the unit matrix, on and above its diagonal. */
static void leave_out_white(Filter *filter) {
    const size_t rows = filter->rows;
    double *white = filter->white;
    for (size_t g = 0; g < filter->solver->n_gauges; g++) {
        if (!filter->solver->sample.used[g]) {
            for (size_t i = 0; i < g; i++) {
                white[i * rows + g] = 0.0;
            }
            memset(white + g * rows + g, 0, (rows - g) * sizeof *white);
            white[g * rows + g] = 1.0;
        }
    }
}

/* Covariance of what is independent from sample to sample, and of the considered errors. */
static void set_white(Filter *filter) {
    const FlightSolver *solver = filter->solver;
    const size_t n = solver->n_gauges, rows = filter->rows;
    const double square = solver->response.pressure * solver->response.pressure;
    double *white = filter->white;
    for (size_t i = 0; i < rows; i++) {
        const size_t at = i * rows + i / LANES * LANES;
        combine(solver->wide, rows - i / LANES * LANES, 1.0, filter->noise + at, square, filter->errors.rest + at, white + at);
    }
    for (size_t i = 0; i < n; i++) {
        for (size_t t = 0; t < filter->n_terms; t++) {
            const double size = filter->term[t * filter->gauges + i];
            white[i * rows + i] += size * size;
        }
    }
    leave_out_white(filter);
    if (filter->laws.zeros.in_use) {
        zero_errors_read(&filter->laws.zeros, solver->sample.used);
        zero_errors_add(&filter->laws.zeros, white, rows);
    }
    for (size_t i = n; i < rows; i++) {
        white[i * rows + i] = 1.0;
    }
    for (size_t k = 0; k < N_NAVIGATION; k++) {
        if (filter->scale[k] > 0.0) {
            /* What is doubted errs more in this sample; what is known of its lasting error stays. */
            white[(filter->gauges + k) * (rows + 1)] = filter->map.white_navigation + filter->doubt[k] - 1.0;
        }
    }
}

void filter_set_errors(Filter *filter) {
    set_read(filter);
    set_terms(filter);
    set_white(filter);
}

void filter_set_slopes(Filter *filter, const Response *response) {
    const FlightSolver *solver = filter->solver;
    const size_t rows = filter->rows;
    const double log_mach_slope = flight_log_mach_slope(response->state[STATE_MACH]);
    double *slopes = filter->read;
    memset(slopes, 0, N_STATES * rows * sizeof *slopes);
    for (size_t g = 0; g < solver->n_gauges; g++) {
        for (size_t k = 0; solver->sample.used[g] && k < N_STATES; k++) {
            slopes[k * rows + g] = response->jacobian[k][g];
        }
    }
    for (size_t m = 0; m < N_NAVIGATION; m++) {
        double row[N_STATES];
        flight_measurement_row(log_mach_slope, m, row);
        for (size_t k = 0; filter->scale[m] > 0.0 && k < N_STATES; k++) {
            navigation_rows(filter, slopes + k * rows)[m] = filter->scale[m] * row[k];
        }
    }
}

void filter_set_innovation(Filter *filter, const Law *law, const double *state) {
    const FlightSolver *solver = filter->solver;
    const Sample *sample = &solver->sample;
    const size_t rows = filter->rows;
    double *apart = filter->innovation, *means = filter->by_row + N_STATES * rows;
    memset(apart, 0, rows * sizeof *apart);
    for (size_t g = 0; g < solver->n_gauges; g++) {
        if (sample->used[g]) {
            apart[g] = sample->strain[g] - solver->response.value[g] - means[g];
        }
    }
    for (size_t m = 0; m < N_NAVIGATION; m++) {
        const double scale = filter->scale[m];
        if (scale > 0.0) {
            navigation_rows(filter, apart)[m] =
                scale * solver->innovation[m] - navigation_rows(filter, means)[m];
        }
    }
    for (size_t k = 0; k < N_STATES; k++) {
        const double about = law->mean[k] - state[k];
        for (size_t r = 0; r < rows; r++) {
            apart[r] -= about * filter->read[k * rows + r];
        }
    }
}
