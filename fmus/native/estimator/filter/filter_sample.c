#include "filter_sample.h"

#include <math.h>

#include "../nonlinear/flight_solve.h"
#include "../numerics/cholesky.h"
#include "../numerics/products.h"
#include "filter_cross.h"
#include "law_update.h"
#include "filter_rows.h"
#include "filter_solution.h"
#include "filter_update.h"

/* The flight state alone moves with the iterations. Given it, strain and navigation have a covariance that does not: one
   decomposition serves all iterations and the law after them. */

/* x = L^-1 x, N_STATES rows of `count` elements. */
static void solve_rows(double root[N_STATES][N_STATES], size_t count, double *rows) {
    for (size_t k = 0; k < N_STATES; k++) {
        double *restrict row = rows + k * count;
        const double scale = 1.0 / root[k][k];
        for (size_t j = 0; j < k; j++) {
            const double *restrict above = rows + j * count;
            const double factor = root[k][j];
            for (size_t i = 0; i < count; i++) {
                row[i] -= factor * above[i];
            }
        }
        for (size_t i = 0; i < count; i++) {
            row[i] *= scale;
        }
    }
}

/* L of a symmetric positive definite matrix whose rows are `row` apart. */
static void set_root(const double *matrix, size_t row, double root[N_STATES][N_STATES]) {
    for (size_t i = 0; i < N_STATES; i++) {
        for (size_t j = 0; j < N_STATES; j++) {
            double rest = matrix[i * row + j];
            for (size_t k = 0; k < j; k++) {
                rest -= root[i][k] * root[j][k];
            }
            root[i][j] = j < i ? rest / root[j][j] : j == i ? sqrt(rest) : 0.0;
        }
    }
}

/* What the flight state tells of the other states and of the considered errors, and what it leaves. */
static void set_given_state(Filter *filter, const Law *law) {
    const size_t rows = filter->rows, order = filter->laws.order, others = filter->laws.n - N_STATES;
    const int wide = filter->solver->wide;
    double *by_state = filter->by_state, *rest = filter->considered + N_STATES * rows;
    const Strided turned = {by_state + N_STATES, 1, order};
    set_root(law->covariance, order, filter->root);
    memcpy(by_state, law->covariance, N_STATES * order * sizeof *by_state);
    solve_rows(filter->root, order, by_state);
    solve_rows(filter->root, rows, filter->considered);
    memcpy(filter->others, law->covariance + N_STATES * order, others * order * sizeof *by_state);
    subtract_product(wide, others, N_STATES, order - N_STATES, turned, by_state + N_STATES, order,
                     filter->others + N_STATES, order);
    subtract_product(wide, others, N_STATES, rows, turned, filter->considered, rows, rest, rows);
    for (size_t i = N_STATES; i < filter->laws.n; i++) {
        by_state[N_STATES * order + i] = law->mean[i];
    }
}

/* out (count, rows) = left (count, order) H' of the other states: gauges read all but b, navigation one b each. */
static void times_read(const Filter *filter, size_t count, const double *left, double *out) {
    const size_t rows = filter->rows, order = filter->laws.order, gauges = filter->gauges;
    multiply(filter->solver->wide, FULL, count, filter->n_read - FIRST_SEEN, gauges, by_rows(left + FIRST_SEEN, order),
             filter->read + FIRST_SEEN * rows, rows, out, rows);
    for (size_t i = 0; i < count; i++) {
        double *navigation = out + i * rows + gauges;
        memset(navigation, 0, (rows - gauges) * sizeof *navigation);
        for (size_t m = 0; m < N_NAVIGATION; m++) {
            navigation[m] = left[i * order + FIRST_NAVIGATION + m] * filter_navigation_read(filter, m);
        }
    }
}

/* The upper triangle of the covariance of what is read given x, which takes its part of the considered errors, too. */
static void set_spread(Filter *filter) {
    const size_t rows = filter->rows, gauges = filter->gauges, count = filter->n_read - FIRST_SEEN;
    const size_t at = (FIRST_SEEN - N_STATES) * rows, last = gauges * (rows + 1);
    const int wide = filter->solver->wide;
    const double *read = filter->read + FIRST_SEEN * rows, *considered = filter->considered;
    double *half = filter->product, *spread = filter->spread;
    /* Of gauges: half of it with half of what is considered, then its transpose. */
    combine(wide, count * rows, 0.5, filter->gain + at, 1.0, considered + FIRST_SEEN * rows, half);
    multiply_upper(wide, gauges, rows, count, (Strided){read, 1, rows}, half, filter->white, spread);
    multiply_upper(wide, gauges, rows, count, (Strided){half, 1, rows}, read, spread, spread);
    subtract_upper(wide, gauges, N_STATES, gauges, (Strided){considered, 1, rows}, considered, rows, spread, rows);
    /* With navigation, and of it. */
    for (size_t i = 0; i < rows; i++) {
        memcpy(spread + i * rows + gauges, filter->white + i * rows + gauges, (rows - gauges) * sizeof *spread);
    }
    for (size_t m = 0; m < N_NAVIGATION; m++) {
        const double read_of = filter_navigation_read(filter, m), *own = filter->gain + m * rows;
        const double *with = considered + (FIRST_NAVIGATION + m) * rows;
        for (size_t i = 0; i < gauges; i++) {
            spread[i * rows + gauges + m] += read_of * (own[i] + with[i]);
        }
        for (size_t j = 0; j < N_NAVIGATION; j++) {
            spread[last + m * rows + j] += read_of * own[gauges + j];
        }
    }
}

/* What does not change with the iterations, for the errors at the state of solver->response. */
static void set_fixed(Filter *filter, const Law *law) {
    const size_t rows = filter->rows, order = filter->laws.order, others = filter->laws.n - N_STATES;
    const size_t first = N_STATES * rows, columns = order - N_STATES;
    const int wide = filter->solver->wide;
    filter_set_errors(filter);
    filter_set_considered(filter, law);
    set_given_state(filter, law);
    times_read(filter, N_STATES + 1, filter->by_state, filter->by_row);
    for (size_t k = 0; k < first; k++) {
        filter->by_row[k] += filter->considered[k];
    }
    times_read(filter, others, filter->others, filter->gain);
    set_spread(filter);
    cholesky(wide, rows, rows, filter->spread);
    invert_lower(wide, rows, filter->spread, filter->product, filter->inverse);
    combine(wide, others * rows, 1.0, filter->gain, 1.0, filter->considered + first, filter->product);
    transpose(others, rows, filter->product, rows, filter->gain_turned, columns);
    multiply(wide, LOWER_LEFT, rows, rows, columns, by_rows(filter->inverse, rows), filter->gain_turned, columns,
             filter->whitened + N_STATES, filter->row_whitened);
}

static void whiten_slopes(Filter *filter) {
    const size_t rows = filter->rows;
    const int wide = filter->solver->wide;
    double gram[N_STATES * N_STATES], root[N_STATES][N_STATES], *row = filter->product;
    memcpy(row, filter->by_row, N_STATES * rows * sizeof *row);
    add_product(wide, N_STATES, N_STATES, rows, (Strided){filter->root[0], 1, N_STATES}, filter->read, rows, row, rows);
    transpose(N_STATES, rows, row, rows, filter->right, N_COLUMNS);
    multiply(wide, LOWER_LEFT, rows, rows, N_STATES, by_rows(filter->inverse, rows), filter->right, N_COLUMNS,
             filter->white_right, N_COLUMNS);
    multiply(wide, FULL, N_STATES, rows, N_STATES, (Strided){filter->white_right, 1, N_COLUMNS}, filter->white_right,
             N_COLUMNS, gram, N_STATES);
    memset(filter->xi_inverse_root, 0, sizeof filter->xi_inverse_root);
    for (size_t k = 0; k < N_STATES; k++) {
        gram[k * N_STATES + k] += 1.0;
        filter->xi_inverse_root[k][k] = 1.0;
    }
    set_root(gram, N_STATES, root);
    solve_rows(root, N_STATES, filter->xi_inverse_root[0]);
}

static void whiten_innovation(Filter *filter) {
    const size_t rows = filter->rows;
    double product[N_STATES] = {0.0}, *innovation = filter->product;
    times_lower(filter->solver->wide, rows, filter->inverse, filter->innovation, innovation);
    for (size_t r = 0; r < rows; r++) {
        double *white = filter->white_right + r * N_COLUMNS;
        white[N_STATES] = innovation[r];
        for (size_t k = 0; k < N_STATES; k++) {
            product[k] += white[k] * white[N_STATES];
        }
    }
    memset(filter->xi_mean, 0, sizeof filter->xi_mean);
    for (size_t j = 0; j < N_STATES; j++) {
        const double *inverse = filter->xi_inverse_root[j];
        double half = 0.0;
        for (size_t k = 0; k <= j; k++) {
            half += inverse[k] * product[k];
        }
        for (size_t k = 0; k <= j; k++) {
            filter->xi_mean[k] += inverse[k] * half;
        }
    }
}

/* The next flight state. */
static void iterate(const Filter *filter, const Law *law, const double *state, double *next) {
    double step[N_STATES];
    for (size_t i = 0; i < N_STATES; i++) {
        step[i] = law->mean[i] - state[i];
        for (size_t k = 0; k <= i; k++) {
            step[i] += filter->root[i][k] * filter->xi_mean[k];
        }
    }
    flight_limited(filter->solver->map, state, step, next);
}

/* Standardised residuals of gauges and navigation. */
static void set_residuals(Filter *filter) {
    Solution *found = &filter->solver->solution;
    const double *weighted = filter->kalman + (filter->laws.n + N_STATES) * filter->rows, *squares = filter->squares;
    for (size_t g = 0; g < filter->solver->n_gauges; g++) {
        found->standardised_residual[g] = filter->solver->sample.used[g] ? weighted[g] / sqrt(squares[g]) : 0.0;
    }
    for (size_t m = 0; m < N_NAVIGATION; m++) {
        const size_t row = filter->gauges + m;
        found->navigation_residual[m] = filter->scale[m] > 0.0 ? weighted[row] / sqrt(squares[row]) : 0.0;
    }
}

/* The problem about a state, that of solver->response: with its slopes, or those that are set. */
static void set_problem(Filter *filter, const Law *law, const double *state, int own_slopes) {
    if (own_slopes) {
        filter_set_slopes(filter, &filter->solver->response);
        whiten_slopes(filter);
    }
    filter_set_innovation(filter, law, state);
    whiten_innovation(filter);
}

void filter_sample(Filter *filter, const Law *law, const double *start, size_t iterations, const double *slopes) {
    FlightSolver *solver = filter->solver;
    const int own_slopes = slopes == NULL;
    double state[N_STATES], next[N_STATES];
    memcpy(state, start, sizeof state);
    flight_evaluate(solver, state);
    set_fixed(filter, law);
    if (!own_slopes) {
        flight_response(&solver->tables, solver->wide, slopes, &filter->slope_response);
        filter_set_slopes(filter, &filter->slope_response);
        whiten_slopes(filter);
    }
    for (size_t k = 0; k < iterations; k++) {
        solver->iterations++;
        set_problem(filter, law, state, own_slopes);
        iterate(filter, law, state, next);
        memcpy(state, next, sizeof state);
        flight_evaluate(solver, state);
    }
    solver->solution.rest_square = 0.0;
    set_problem(filter, law, state, own_slopes);
    law_note(&filter->laws, &filter->laws.next_law);
    const double chi_square = filter_update_law(filter, law, &filter->laws.next_law);
    solver->solution.chi_square = chi_square + filter_give(filter, &filter->laws.next_law, state);
    set_residuals(filter);
    /* What is left of strain follows from the slopes at the estimate. */
    filter_set_slopes(filter, &solver->response);
    filter_solution(filter);
    filter->found = filter->laws.next_law;
}
