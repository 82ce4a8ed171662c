#include "scaled_suspects.h"

#include <math.h>
#include <string.h>

#include "../numerics/dense.h"
#include "../numerics/wide.h"
#include "current_errors.h"
#include "suspects.h"

/* |w|^2 up to which float holds w and the products with it. */
#define LARGEST_SCREENED 0x1p40

/* Whether some |z| may be above the limit. z^2 = (V_i' x)^2 / P_ii, where y = V_i' x / |V_i| was found in float and errs
   by no more than error * margin; bound is no less than |V_i|^2 / P_ii. A number that is not finite counts as above. */
EVERYWHERE int any_above(size_t n, const float *restrict y, const double *restrict margin, const double *restrict bound,
                         double error, double square) {
    int below = 1;
    for (size_t i = 0; i < n; i++) {
        const double largest = fabs((double)y[i]) + error * margin[i] + 1e-30;
        below &= largest * largest * bound[i] <= square;
    }
    return !below;
}

/* 0 only if no |z| is above the threshold. See suspects.c for the error of the product in float: at most
   (n + 4) 2^-23 sum_a |V_ai| u_a |w_a| with x = D (D w), which by Cauchy and Schwarz is at most the root of chi-square
   times that of P_ii with all gauges. 1e-5 of the limit covers all rounding in double. */
EVERYWHERE int may_exceed(Estimator *e, double threshold) {
    const size_t n = e->map.n_gauges;
    ScaledStep *step = &e->scaled.step;
    const double chi_square = step->chi_square;
    if (!(chi_square <= LARGEST_SCREENED) || chi_square > e->output[CHI_SQUARE_LIMIT]) {
        return 1;
    }
    const Interval *interval = step->interval;
    const int bounded = step->n_lost == 0 ? interval->bounded
                                          : current_errors_set_bound(e, interval, step->n_lost, step->bound);
    if (!bounded) {
        return 1;
    }
    const double *bound = step->n_lost == 0 ? interval->bound : step->bound;
    for (size_t a = 0; a < n; a++) {
        step->narrow[a] = (float)step->x[a];
    }
    narrow_times(e->wide, n, n, e->scaled.screen, step->narrow, step->narrow_z);
    const double error = (double)(n + 4) * 0x1p-23 * sqrt(chi_square);
    return any_above(n, step->narrow_z, interval->margin, bound, error, threshold * threshold * (1.0 - 1e-5));
}

#if HAS_AVX2
AVX2 static int may_exceed_avx2(Estimator *e, double threshold) {
    return may_exceed(e, threshold);
}
#endif

void scaled_standardised_residuals(Estimator *e, double *z) {
    const size_t n = e->map.n_gauges;
    const MaskedMap *m = e->masked;
    const ScaledStep *step = &e->scaled.step;
    double *slope = e->scaled.step.scratch[0], *precisions = e->scaled.step.scratch[1];
    dense_times(e->wide, n, n, e->scaled.columns, step->x, slope);
    dense_times(e->wide, n, n, e->scaled.square, step->unresolved, precisions);
    for (size_t j = 0; j < step->n_lost; j++) {
        const double *y = step->y + j * dense_rows(n);
        for (size_t i = 0; i < n; i++) {
            precisions[i] -= y[i] * y[i];
        }
    }
    for (size_t k = 0; k < m->n_used; k++) {
        const size_t gauge = m->used[k];
        const double precision = precisions[gauge];
        const int checked = precision > e->map.form.min_precision[gauge];
        z[gauge] = checked ? slope[gauge] / sqrt(precision) : 0.0;
    }
}

void set_scaled_suspects(Estimator *e, double threshold) {
    const MaskedMap *m = e->masked;
    if (!CHOSEN(e->wide, may_exceed)(e, threshold)) {
        return;
    }
    double *z = e->scaled.step.bound;
    size_t worst = 0;
    double largest = 0.0;
    scaled_standardised_residuals(e, z);
    for (size_t k = 0; k < m->n_used; k++) {
        const double size = fabs(z[m->used[k]]);
        if (size > largest) {
            largest = size;
            worst = k;
        }
    }
    if (largest > threshold) {
        name_suspects(e, worst);
    }
}
