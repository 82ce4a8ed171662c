#include "filter_update.h"

#include "../numerics/cholesky.h"
#include "../numerics/products.h"
#include "filter_cross.h"
#include "law_update.h"

/* Copy what is above the diagonal to below it. */
static void mirror(size_t n, size_t row, double *matrix) {
    for (size_t i = 0; i < n; i++) {
        for (size_t j = 0; j < i; j++) {
            matrix[i * row + j] = matrix[j * row + i];
        }
    }
}

/* C G' of all states, in filter->gain. */
static void set_whole(Filter *filter) {
    const size_t n = filter->laws.n, order = filter->laws.order, rows = filter->rows, first = N_STATES * rows;
    double *whole = filter->gain;
    memset(whole, 0, first * sizeof *whole);
    memcpy(whole + first, filter->considered + first, (n * rows - first) * sizeof *whole);
    add_product(filter->solver->wide, n, N_STATES, rows, (Strided){filter->by_state, 1, order}, filter->considered, rows,
                whole, rows);
}

/* Mean after the sample, and the root of what x has of the covariance. */
static void set_of_states(Filter *filter, const Law *law, Law *after) {
    const size_t n = filter->laws.n, order = filter->laws.order;
    double *taken = filter->product;
    multiply(filter->solver->wide, FULL, N_STATES + 1, filter->rows, order - N_STATES,
             (Strided){filter->white_right, 1, N_COLUMNS}, filter->whitened + N_STATES, filter->row_whitened,
             taken + N_STATES, order);
    for (size_t i = 0; i < n; i++) {
        const int is_other = i >= N_STATES;
        double left[N_STATES], mean = law->mean[i] + (is_other ? taken[N_STATES * order + i] : 0.0);
        for (size_t k = 0; k < N_STATES; k++) {
            left[k] = is_other ? filter->by_state[k * order + i] - taken[k * order + i] : filter->root[i][k];
            mean += left[k] * filter->xi_mean[k];
        }
        after->mean[i] = mean;
        for (size_t j = 0; j < N_STATES; j++) {
            double sum = 0.0;
            for (size_t k = 0; k <= j; k++) {
                sum += left[k] * filter->xi_inverse_root[j][k];
            }
            filter->of_states[j * order + i] = sum;
        }
    }
}

/* P after the sample: what x does not tell of the others, less what the sample tells of it, and what x has; the same as
   the Joseph form but for round-off. Whether it has digits enough: where the sample takes nearly all of a variance,
   little is left of the difference. */
static int update_covariance(Filter *filter, Law *after) {
    const size_t n = filter->laws.n, order = filter->laws.order, others = n - N_STATES, columns = order - N_STATES;
    const int wide = filter->solver->wide;
    const double *whitened = filter->whitened + N_STATES, *of_states = filter->of_states;
    double *rest = after->covariance + N_STATES * order;
    int enough = 1;
    memcpy(rest, filter->others, others * order * sizeof *rest);
    subtract_upper(wide, others, filter->rows, columns, (Strided){whitened, 1, filter->row_whitened}, whitened,
                 filter->row_whitened, rest + N_STATES, order);
    for (size_t i = 0; i < others; i++) {
        const size_t at = i * order + N_STATES + i;
        enough = enough && rest[at] > LEAST_LEFT * filter->others[at];
    }
    add_upper(wide, others, N_STATES, columns, (Strided){of_states + N_STATES, 1, order}, of_states + N_STATES,
                 order, rest + N_STATES, order);
    multiply(wide, FULL, N_STATES, N_STATES, order, (Strided){of_states, 1, order}, of_states, order, after->covariance,
             order);
    mirror(n, order, after->covariance);
    return enough;
}

/* Columns of x over the root of its precision, and the innovation that x does not tell, behind those of the states; then
   K, S^-1 times the innovation, and the diagonal of S^-1. The normalised innovation squared. */
static double set_kalman(Filter *filter) {
    const size_t n = filter->laws.n, order = filter->laws.order, rows = filter->rows, row = filter->row_whitened;
    const int wide = filter->solver->wide;
    double *kalman = filter->kalman, *of_x = kalman + n * rows, *squares = filter->squares, chi_square = 0.0;
    for (size_t r = 0; r < rows; r++) {
        const double *white = filter->white_right + r * N_COLUMNS;
        double *own = filter->whitened + r * row + n, left = white[N_STATES];
        for (size_t j = 0; j < N_STATES; j++) {
            double sum = 0.0;
            for (size_t k = 0; k <= j; k++) {
                sum += white[k] * filter->xi_inverse_root[j][k];
            }
            own[j] = sum;
            left -= white[j] * filter->xi_mean[j];
        }
        own[N_STATES] = left;
        chi_square += left * left;
    }
    /* Of the others given x, of x and of the innovation; then all states take their part of x. */
    multiply(wide, LOWER, n + 1, rows, rows, (Strided){filter->whitened + N_STATES, 1, row}, filter->inverse, rows,
             kalman + N_STATES * rows, rows);
    multiply(wide, FULL, N_STATES, N_STATES, rows, (Strided){filter->of_states, 1, order}, of_x, rows, kalman, rows);
    add_product(wide, n - N_STATES, N_STATES, rows, (Strided){filter->of_states + N_STATES, 1, order}, of_x, rows,
                kalman + N_STATES * rows, rows);
    column_squares(wide, rows, filter->inverse, squares);
    for (size_t k = 0; k < N_STATES; k++) {
        const double *taken = of_x + k * rows;
        for (size_t r = 0; r < rows; r++) {
            squares[r] -= taken[r] * taken[r];
        }
        chi_square += filter->xi_mean[k] * filter->xi_mean[k];
    }
    return chi_square;
}

/* K H: gauges read no b, and navigation of the others than x one b each. */
static void set_kept(Filter *filter) {
    const size_t n = filter->laws.n, order = filter->laws.order, rows = filter->rows, gauges = filter->gauges;
    const size_t seen = filter->n_read - FIRST_SEEN, columns = in_lanes(seen);
    const int wide = filter->solver->wide;
    const Strided kalman = by_rows(filter->kalman, rows);
    double *kept = filter->kept;
    transpose(N_STATES, rows, filter->read, rows, filter->turned, N_STATES);
    multiply(wide, FULL, n, rows, N_STATES, kalman, filter->turned, N_STATES, kept, order);
    transpose(seen, gauges, filter->read + FIRST_SEEN * rows, rows, filter->turned, columns);
    multiply(wide, FULL, n, gauges, columns, kalman, filter->turned, columns, kept + FIRST_SEEN, order);
    for (size_t m = 0; m < N_NAVIGATION; m++) {
        const double read = filter_navigation_read(filter, m);
        for (size_t i = 0; i < n; i++) {
            kept[i * order + FIRST_NAVIGATION + m] = kalman.value[i * rows + gauges + m] * read;
        }
    }
}

double filter_update_law(Filter *filter, const Law *law, Law *after) {
    set_of_states(filter, law, after);
    const int enough = update_covariance(filter, after);
    const double chi_square = set_kalman(filter);
    set_kept(filter);
    const Joseph joseph = {.rows = filter->rows,         .n_read = filter->n_read,   .gain = filter->kalman,
                           .read = filter->kept,         .white = filter->white,     .considered = filter->gain,
                           .half = filter->product,      .turned = filter->turned,   .square = filter->joseph};
    if (!enough) {
        set_whole(filter);
        mirror(filter->rows, filter->rows, filter->white);
        law_set_joseph(&filter->laws, &joseph, law, after);
    }
    filter_update_cross(filter, law, after);
    law_update_zeros(&filter->laws, &joseph, law, after);
    return chi_square;
}

double filter_give(Filter *filter, Law *law, const double *state) {
    double known[N_STATES * N_STATES], inverse[N_STATES * N_STATES], apart[N_STATES], weight[N_STATES], distance = 0.0;
    for (size_t i = 0; i < N_STATES; i++) {
        memcpy(known + i * N_STATES, law->covariance + i * filter->laws.order, N_STATES * sizeof *known);
        apart[i] = state[i] - law->mean[i];
    }
    invert_small(N_STATES, known, inverse);
    for (size_t i = 0; i < N_STATES; i++) {
        weight[i] = 0.0;
        for (size_t j = 0; j < N_STATES; j++) {
            weight[i] += inverse[i * N_STATES + j] * apart[j];
        }
        distance += apart[i] * weight[i];
    }
    for (size_t i = 0; i < filter->laws.n; i++) {
        for (size_t k = 0; k < N_STATES; k++) {
            law->mean[i] += law->covariance[i * filter->laws.order + k] * weight[k];
        }
    }
    memcpy(law->mean, state, N_STATES * sizeof *state);
    return distance;
}
