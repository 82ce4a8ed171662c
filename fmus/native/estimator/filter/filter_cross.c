#include "filter_cross.h"

#include "../numerics/blocks.h"
#include "../numerics/products.h"
#include "predict.h"

/* It is the largest part of a law. That of a predicted law is not stored: it is moved where it is used. */

/* Whether a law is the predicted one. What else a sample starts from, the stationary law, has none. */
static int is_predicted(const Filter *filter, const Law *law) {
    return law == &filter->laws.predicted;
}

void filter_set_considered(Filter *filter, const Law *law) {
    const size_t n = filter->laws.n, rows = filter->rows;
    double *sums = filter->product;
    if (!is_predicted(filter, law)) {
        memset(filter->considered, 0, n * rows * sizeof *sums);
        return;
    }
    memset(sums, 0, n * rows * sizeof *sums);
    for (size_t i = 0; i < n; i++) {
        sum_of_products(filter->solver->wide, filter->n_terms, filter->gauges,
                        filter->laws.law.cross + i * filter->laws.n_considered, filter->term, sums + i * rows);
    }
    laws_move_rows(&filter->laws, rows, filter->laws.motion.of_considered, sums, filter->considered);
    if (filter->laws.zeros.in_use) {
        zero_errors_considered(&filter->laws.zeros, n, law->of_zeros, filter->considered, rows);
    }
}

/* Some columns of the predicted covariance, side by side, in filter->strip. */
EVERYWHERE void move_strip(size_t width, const Filter *filter, const double *restrict from) {
    const size_t count = filter->laws.n_considered, read = filter->n_read;
    const Motion *motion = &filter->laws.motion;
    const double scale = motion->of_considered;
    double *restrict moved = filter->strip;
    for (size_t k = 0; k < N_STATES; k++) {
        const double *restrict x = from + k * count, *restrict v = from + (read + k) * count;
        const double own = scale * motion->pair[k][0][0], of_rate = scale * motion->pair[k][0][1];
        const double of_state = scale * motion->pair[k][1][0], of_own = scale * motion->pair[k][1][1];
        for (size_t c = 0; c < width; c++) {
            moved[k * width + c] = own * x[c] + of_rate * v[c];
            moved[(read + k) * width + c] = of_state * x[c] + of_own * v[c];
        }
    }
    for (size_t i = N_STATES; i < read; i++) {
        const double factor = scale * motion->factor[i];
        for (size_t c = 0; c < width; c++) {
            moved[i * width + c] = factor * from[i * count + c];
        }
    }
}

/* C - K G - K H C of some rows and columns; C lies in `moved`, a row `columns` behind the one before. All of it is a
   constant where it is called. */
EVERYWHERE void update_block(size_t rows, size_t columns, size_t read, const double *restrict kept, size_t order,
                             const double *restrict moved, size_t first, const double *restrict gain, size_t gain_row,
                             const double *restrict size, double *restrict after, size_t count) {
    double sum[MOST_ROWS][WIDE_COLUMNS];
    for (size_t i = 0; i < rows; i++) {
        for (size_t c = 0; c < columns; c++) {
            sum[i][c] = moved[(first + i) * columns + c] - gain[i * gain_row + c] * size[c];
        }
    }
    for (size_t k = 0; k < read; k++) {
        for (size_t i = 0; i < rows; i++) {
            const double factor = kept[i * order + k];
            for (size_t c = 0; c < columns; c++) {
                sum[i][c] -= factor * moved[k * columns + c];
            }
        }
    }
    for (size_t i = 0; i < rows; i++) {
        for (size_t c = 0; c < columns; c++) {
            after[i * count + c] = sum[i][c];
        }
    }
}

/* The same of all rows; the columns begin at a term and a gauge. */
EVERYWHERE void update_strip(size_t width, const Filter *filter, size_t term, size_t gauge, const double *before,
                             double *after) {
    const size_t count = filter->laws.n_considered, at = term * filter->gauges + gauge;
    const size_t rows = filter->rows, n = filter->laws.n;
    const double *restrict size = filter->term + at;
    size_t i = 0;
    if (before == NULL) {
        memset(filter->strip, 0, n * width * sizeof *after);
    } else {
        move_strip(width, filter, before + at);
    }
#define SOME_ROWS(some) \
    update_block(some, width, filter->n_read, filter->kept + i * filter->laws.order, filter->laws.order, filter->strip, i, \
                 filter->kalman + i * rows + gauge, rows, size, after + i * count + at, count)
    BY_ROWS(i, n, SOME_ROWS)
#undef SOME_ROWS
}

EVERYWHERE void update_strips(size_t width, const Filter *filter, const double *before, double *after) {
    for (size_t term = 0; term < filter->n_terms; term++) {
        size_t gauge = 0;
#define SOME_COLUMNS(count) update_strip(count, filter, term, gauge, before, after)
        BY_COLUMNS(gauge, filter->gauges, width, 1, SOME_COLUMNS)
#undef SOME_COLUMNS
    }
}

static void update(const Filter *filter, const double *before, double *after) {
    update_strips(NARROW_COLUMNS, filter, before, after);
}

#if HAS_AVX2
AVX2 static void update_avx2(const Filter *filter, const double *before, double *after) {
    update_strips(BLOCK_COLUMNS, filter, before, after);
}

AVX512 static void update_avx512(const Filter *filter, const double *before, double *after) {
    update_strips(WIDE_COLUMNS, filter, before, after);
}
#endif

void filter_update_cross(Filter *filter, const Law *law, Law *after) {
    const double *before = is_predicted(filter, law) ? filter->laws.law.cross : NULL;
    WIDEST(filter->solver->wide, update)(filter, before, after->cross);
}
