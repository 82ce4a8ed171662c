/* Many gauges: what low_rank_columns.c, low_rank_points.c and low_rank.c share. */

#ifndef LOW_RANK_H
#define LOW_RANK_H

#include "update.h"

#include <string.h>

#define TILE 8 /* columns are laid out in multiples of it */

/* The interval of a step, and the polynomials of Lagrange at its ratio. */
void low_rank_at(Scaled *scaled, const MaskedMap *masked, double s);

/* `count` numbers at the ratio of the step from those at all points. */
void low_rank_between(const Scaled *scaled, size_t count, const double *at_points, double *out);

/* w of a set of gauges, 0 for lost ones; C at a ratio of 1, of n_lost lost gauges, 0 where A has no root there. */
void low_rank_weights(const Scaled *scaled, const unsigned char *mask, double s, double *weight);
int low_rank_nominal_covariance(Scaled *scaled, const unsigned char *mask, size_t n_lost, double *covariance);

/* The size of a column at a ratio. */
static inline double size_at(const LowRank *low, double s, size_t column) {
    if (column < low->n_scaled) {
        return s * low->size[column];
    }
    return low->prior[column] > 0.0 ? 1.0 : s;
}

/* C x of a packed C. */
EVERYWHERE void times_covariance(size_t order, const double *restrict covariance, const double *restrict x,
                                 double *restrict out) {
    memset(out, 0, order * sizeof *out);
    for (size_t i = 0; i < order; i++) {
        out[i] += sum_of_products(order - i, covariance, x + i);
        add_times(order - i - 1, x[i], covariance + 1, out + i + 1);
        covariance += order - i;
    }
}

#endif
