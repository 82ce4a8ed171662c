/* A sample by the filter: strainfmu/estimator/filter/flight_model.py, flight_step.py, kalman.py.

   Rows that are not in use read nothing, with a noise of 1. The Jacobian by the flight state alone follows the
   iterations: what the other states read is computed once. */

#include <math.h>

#include "filter.h"
#include "flight_algebra.h"

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
    for (size_t t = 0; t < count; t++) {
        for (size_t g = 0; g < n; g++) {
            double sum = 0.0;
            for (size_t a = 0; a <= N_LOADS; a++) {
                sum += error[(t * (1 + N_LOADS) + a) * n + g] * c[a];
            }
            out[t * row + g] = solver->response.pressure * sum;
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
    memset(filter->read, 0, filter->order * rows * sizeof *filter->read);
    for (size_t k = 0; k < N_NAVIGATION; k++) {
        filter->scale[k] = sqrt(solver->sample.precision[k]);
        if (filter->scale[k] > 0.0) {
            double *own = filter->read + (FIRST_NAVIGATION + k) * rows;
            navigation_rows(filter, own)[k] = sqrt(1.0 - map->white_navigation);
        }
    }
    for (size_t g = 0; g < n; g++) {
        for (size_t k = 0; k < map->n_seen; k++) {
            seen[k * rows + g] = pressure * map->seen_strain[k * n + g];
        }
        gain[g] = flight->common_gain[g] * solver->response.value[g];
        for (size_t k = 0; k < map->n_shared; k++) {
            shared[k * rows + g] = map->shared[k * n + g];
        }
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

/* Covariance of what is independent from sample to sample, and of the considered errors. */
static void set_white(Filter *filter) {
    const FlightSolver *solver = filter->solver;
    const FilterMap *map = &filter->map;
    const unsigned char *used = solver->sample.used;
    const size_t n = solver->n_gauges, rows = filter->rows;
    const double square = solver->response.pressure * solver->response.pressure;
    memset(filter->white, 0, rows * rows * sizeof *filter->white);
    for (size_t i = 0; i < rows; i++) {
        filter->white[i * rows + i] = 1.0;
    }
    for (size_t i = 0; i < n; i++) {
        if (!used[i]) {
            continue;
        }
        for (size_t j = 0; j < n; j++) {
            const double value = map->noise[i * n + j] + square * map->rest_strain[i * n + j];
            filter->white[i * rows + j] = used[j] ? value : 0.0;
        }
        for (size_t t = 0; t < filter->n_terms; t++) {
            const double size = filter->term[t * filter->gauges + i];
            filter->white[i * rows + i] += size * size;
        }
    }
    for (size_t k = 0; k < N_NAVIGATION; k++) {
        if (filter->scale[k] > 0.0) {
            filter->white[(filter->gauges + k) * (rows + 1)] = map->white_navigation;
        }
    }
}

/* C G'. */
static void set_considered(Filter *filter, const Law *law) {
    memset(filter->considered, 0, filter->n * filter->rows * sizeof *filter->considered);
    for (size_t i = 0; i < filter->n; i++) {
        sum_of_products(filter->solver->wide, filter->n_terms, filter->gauges, law->cross + i * filter->n_considered,
                        filter->term, filter->considered + i * filter->rows);
    }
}

/* The upper triangle of fixed + the sum over `count` pairs of rows of left right' + right left', in `matrix`. */
static void add_spread(Filter *filter, size_t count, const double *left, const double *right, const double *fixed,
                       double *matrix) {
    const size_t rows = filter->rows;
    const int wide = filter->solver->wide;
    multiply_upper(wide, rows, count, (Strided){left, 1, rows}, right, fixed, matrix);
    multiply_upper(wide, rows, count, (Strided){right, 1, rows}, left, matrix, matrix);
}

/* What does not change with the iterations, for the errors at the state of solver->response. */
static void set_fixed(Filter *filter, const Law *law) {
    const size_t rows = filter->rows, others = filter->n_read - N_STATES, first = N_STATES * rows;
    const int wide = filter->solver->wide;
    set_read(filter);
    set_terms(filter);
    set_white(filter);
    set_considered(filter, law);
    multiply(wide, FULL, filter->n, others, rows, by_rows(law->covariance + N_STATES, filter->order),
             filter->read + first, rows, filter->fixed_gain, rows);
    for (size_t k = 0; k < filter->n * rows; k++) {
        filter->fixed_gain[k] += filter->considered[k];
    }
    for (size_t k = first; k < filter->n_read * rows; k++) {
        filter->product[k] = 0.5 * (filter->fixed_gain[k] + filter->considered[k]);
    }
    add_spread(filter, others, filter->read + first, filter->product + first, filter->white, filter->fixed_spread);
    multiply(wide, FULL, 1, others, rows, by_rows(law->mean + N_STATES, 1), filter->read + first, rows,
             filter->fixed_value, rows);
}

/* The Jacobian by the flight state at that of solver->response, and the innovation, filter->innovation. */
static void set_rows(Filter *filter, const Law *law, const double *state) {
    const FlightSolver *solver = filter->solver;
    const Sample *sample = &solver->sample;
    const size_t rows = filter->rows;
    double *apart = filter->innovation;
    memset(apart, 0, rows * sizeof *apart);
    memset(filter->read, 0, N_STATES * rows * sizeof *filter->read);
    for (size_t g = 0; g < solver->n_gauges; g++) {
        if (sample->used[g]) {
            apart[g] = sample->strain[g] - solver->response.value[g] - filter->fixed_value[g];
            for (size_t k = 0; k < N_STATES; k++) {
                filter->read[k * rows + g] = solver->response.jacobian[k][g];
            }
        }
    }
    for (size_t m = 0; m < N_NAVIGATION; m++) {
        double row[N_STATES];
        const double scale = filter->scale[m];
        if (scale > 0.0) {
            flight_measurement_row(solver, m, row);
            navigation_rows(filter, apart)[m] =
                scale * solver->innovation[m] - navigation_rows(filter, filter->fixed_value)[m];
            for (size_t k = 0; k < N_STATES; k++) {
                navigation_rows(filter, filter->read + k * rows)[m] = scale * row[k];
            }
        }
    }
    for (size_t k = 0; k < N_STATES; k++) {
        const double about = law->mean[k] - state[k];
        for (size_t r = 0; r < rows; r++) {
            apart[r] -= about * filter->read[k * rows + r];
        }
    }
}

void filter_set_gain(Filter *filter, const Law *law, size_t count) {
    const size_t rows = filter->rows, of_state = N_STATES * rows;
    const int wide = filter->solver->wide;
    double *half = filter->product;
    multiply(wide, FULL, count, N_STATES, rows, by_rows(law->covariance, filter->order), filter->read, rows, filter->gain,
             rows);
    combine(wide, of_state, 1.0, filter->fixed_gain, 0.5, filter->gain, half);
    add_spread(filter, N_STATES, filter->read, half, filter->fixed_spread, filter->spread);
    for (size_t k = 0; k < count * rows; k++) {
        filter->gain[k] += filter->fixed_gain[k];
    }
    cholesky(wide, rows, filter->spread);
}

/* The next flight state. */
static void iterate(Filter *filter, const Law *law, const double *state, double *next) {
    double step[N_STATES];
    const size_t rows = filter->rows;
    double *whitened = filter->whitened, *innovation = whitened + N_STATES * rows;
    filter_set_gain(filter, law, N_STATES);
    memcpy(whitened, filter->gain, N_STATES * rows * sizeof *whitened);
    memcpy(innovation, filter->innovation, rows * sizeof *innovation);
    solve_lower(filter->solver->wide, rows, filter->spread, N_STATES + 1, whitened);
    for (size_t k = 0; k < N_STATES; k++) {
        step[k] = law->mean[k] - state[k] + lane_dot(rows, whitened + k * rows, innovation);
    }
    flight_limited(filter->solver->map, state, step, next);
}

/* Standardised residuals of gauges and navigation. */
static void set_residuals(Filter *filter) {
    Solution *found = &filter->solver->solution;
    const double *weighted = filter->kalman + filter->n * filter->rows, *squares = filter->squares;
    for (size_t g = 0; g < filter->solver->n_gauges; g++) {
        found->standardised_residual[g] = filter->solver->sample.used[g] ? weighted[g] / sqrt(squares[g]) : 0.0;
    }
    for (size_t m = 0; m < N_NAVIGATION; m++) {
        const size_t row = filter->gauges + m;
        found->navigation_residual[m] = filter->scale[m] > 0.0 ? weighted[row] / sqrt(squares[row]) : 0.0;
    }
}

void filter_sample(Filter *filter, const Law *law, const double *start, size_t iterations) {
    FlightSolver *solver = filter->solver;
    double state[N_STATES], next[N_STATES];
    memcpy(state, start, sizeof state);
    flight_evaluate(solver, state);
    set_fixed(filter, law);
    for (size_t k = 0; k < iterations; k++) {
        set_rows(filter, law, state);
        iterate(filter, law, state, next);
        memcpy(state, next, sizeof state);
        flight_evaluate(solver, state);
    }
    set_rows(filter, law, state);
    filter_update_law(filter, law, &filter->next_law);
    const double *weighted = filter->kalman + filter->n * filter->rows;
    solver->solution.chi_square =
        lane_dot(filter->rows, filter->innovation, weighted) + filter_give(filter, &filter->next_law, state);
    set_residuals(filter);
    filter_solution(filter);
    filter->found = filter->next_law;
}
