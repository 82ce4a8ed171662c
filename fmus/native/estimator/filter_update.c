/* The law after a sample: strainfmu/estimator/filter/kalman.py. */

#include "filter.h"
#include "flight_algebra.h"

#define LEAST_LEFT 1e-2 /* part of a variance that is left, above which a difference has digits enough */

/* out (columns, rows) = matrix' (rows, columns), each a row apart from the next. */
static void transpose(size_t rows, size_t columns, const double *matrix, size_t row, double *out, size_t out_row) {
    for (size_t i = 0; i < rows; i++) {
        for (size_t j = 0; j < columns; j++) {
            out[j * out_row + i] = matrix[i * row + j];
        }
    }
}

/* P after the sample, in Joseph form: A P A' + X + X' with X = (K R / 2 - A C G') K', R of what is white and considered. */
static void joseph_covariance(Filter *filter, const Law *law, Law *after) {
    const size_t n = filter->n, order = filter->order, rows = filter->rows;
    const int wide = filter->solver->wide;
    double *first = filter->joseph, *second = filter->joseph + order * order, *half = filter->product;
    const Strided kept = by_rows(filter->kept, order), gain = by_rows(filter->kalman, rows);
    multiply(wide, FULL, n, rows, rows, gain, filter->white, rows, half, rows);
    multiply(wide, FULL, n, n, rows, kept, filter->considered, rows, filter->gain, rows);
    for (size_t k = 0; k < n * rows; k++) {
        half[k] = 0.5 * half[k] - filter->gain[k];
    }
    transpose(n, rows, filter->kalman, rows, filter->turned, order);
    multiply(wide, FULL, n, rows, order, by_rows(half, rows), filter->turned, order, second, order);
    multiply(wide, FULL, n, n, order, kept, law->covariance, order, first, order);
    transpose(n, n, filter->kept, order, filter->turned, order);
    multiply(wide, FULL, n, n, order, by_rows(first, order), filter->turned, order, after->covariance, order);
    for (size_t i = 0; i < n; i++) {
        for (size_t j = 0; j <= i; j++) {
            const double sum = second[i * order + j] + second[j * order + i];
            const double both = after->covariance[i * order + j] + after->covariance[j * order + i];
            after->covariance[i * order + j] = after->covariance[j * order + i] = 0.5 * both + sum;
        }
    }
}

/* P after the sample: P - V V' with V of the gain times L'^-1, the same as the Joseph form but for round-off. Where the
   sample takes nearly all of a variance, little is left of the difference: then the Joseph form. */
static void update_covariance(Filter *filter, const Law *law, Law *after) {
    const size_t n = filter->n, order = filter->order, rows = filter->rows;
    double *taken = filter->joseph;
    int enough = 1;
    transpose(n, rows, filter->whitened, rows, filter->turned, order);
    multiply(filter->solver->wide, FULL, n, rows, order, by_rows(filter->whitened, rows), filter->turned, order, taken,
             order);
    for (size_t i = 0; i < n; i++) {
        const double before = law->covariance[i * order + i];
        enough = enough && before - taken[i * order + i] > LEAST_LEFT * before;
    }
    if (!enough) {
        joseph_covariance(filter, law, after);
        return;
    }
    combine(filter->solver->wide, n * order, 1.0, law->covariance, -1.0, taken, after->covariance);
    for (size_t i = 0; i < n; i++) {
        for (size_t j = 0; j < i; j++) {
            after->covariance[i * order + j] = after->covariance[j * order + i];
        }
    }
}

/* C after the sample: A C - K G. */
static void update_cross(Filter *filter, const Law *law, Law *after) {
    const size_t n = filter->n, read = filter->n_read, count = filter->n_considered;
    const int wide = filter->solver->wide;
    multiply(wide, FULL, n, read, count, by_rows(filter->kept, filter->order), law->cross, count, after->cross, count);
    for (size_t i = read; i < n; i++) { /* rates: A is 1 */
        const double *own = law->cross + i * count;
        double *cross = after->cross + i * count;
        for (size_t k = 0; k < count; k++) {
            cross[k] += own[k];
        }
    }
    for (size_t i = 0; i < n; i++) {
        subtract_products(wide, filter->n_terms, filter->gauges, filter->kalman + i * filter->rows, filter->term,
                          after->cross + i * count);
    }
}

/* K, S^-1 times the innovation, and the diagonal of S^-1. */
static void set_kalman(Filter *filter) {
    const size_t n = filter->n, rows = filter->rows;
    const int wide = filter->solver->wide;
    double *squares = filter->squares;
    invert_lower(wide, rows, filter->spread, filter->product, filter->inverse);
    transpose(rows, rows, filter->inverse, rows, filter->inverse_turned, rows);
    memcpy(filter->gain + n * rows, filter->innovation, rows * sizeof *filter->gain);
    multiply(wide, UPPER, n + 1, rows, rows, by_rows(filter->gain, rows), filter->inverse_turned, rows, filter->whitened,
             rows);
    multiply(wide, LOWER, n + 1, rows, rows, by_rows(filter->whitened, rows), filter->inverse, rows, filter->kalman, rows);
    memset(squares, 0, rows * sizeof *squares);
    for (size_t i = 0; i < rows; i++) {
        for (size_t j = 0; j < i / LANES * LANES + LANES; j++) {
            squares[j] += filter->inverse[i * rows + j] * filter->inverse[i * rows + j];
        }
    }
}

void filter_update_law(Filter *filter, const Law *law, Law *after) {
    const size_t n = filter->n, order = filter->order, rows = filter->rows, read = filter->n_read;
    const int wide = filter->solver->wide;
    double *turned = filter->turned;
    filter_set_gain(filter, law, n);
    set_kalman(filter);
    transpose(read, rows, filter->read, rows, turned, order);
    for (size_t r = 0; r < rows; r++) {
        memset(turned + r * order + read, 0, (order - read) * sizeof *turned);
    }
    multiply(wide, FULL, n, rows, order, by_rows(filter->kalman, rows), turned, order, filter->kept, order);
    for (size_t i = 0; i < n; i++) {
        for (size_t j = 0; j < order; j++) {
            filter->kept[i * order + j] = (i == j ? 1.0 : 0.0) - filter->kept[i * order + j];
        }
        after->mean[i] = law->mean[i] + lane_dot(rows, filter->kalman + i * rows, filter->innovation);
    }
    update_covariance(filter, law, after);
    update_cross(filter, law, after);
}

double filter_give(Filter *filter, Law *law, const double *state) {
    double known[N_STATES * N_STATES], inverse[N_STATES * N_STATES], apart[N_STATES], weight[N_STATES], distance = 0.0;
    for (size_t i = 0; i < N_STATES; i++) {
        memcpy(known + i * N_STATES, law->covariance + i * filter->order, N_STATES * sizeof *known);
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
    for (size_t i = 0; i < filter->n; i++) {
        for (size_t k = 0; k < N_STATES; k++) {
            law->mean[i] += law->covariance[i * filter->order + k] * weight[k];
        }
    }
    memcpy(law->mean, state, N_STATES * sizeof *state);
    return distance;
}
