#include "scaled_suspects.h"

#include <math.h>
#include <string.h>

#include "../numerics/dense.h"
#include "../numerics/triangles.h"
#include "../numerics/wide.h"
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

/* Upper bounds of |V_i|^2 / P_ii from the tangents of both levels. */
EVERYWHERE void set_bound(size_t n, const Level *low, const Level *high, double t, double *restrict bound) {
    const double *restrict low_inverse = low->inverse, *restrict low_slope = low->slope;
    const double *restrict high_inverse = high->inverse, *restrict high_slope = high->slope;
    const double *restrict checked = low->checked;
    const double from_low = t - low->ratio * low->ratio, from_high = t - high->ratio * high->ratio;
    for (size_t i = 0; i < n; i++) {
        const double a = low_inverse[i] + low_slope[i] * from_low, b = high_inverse[i] + high_slope[i] * from_high;
        bound[i] = (a < b ? a : b) * checked[i];
    }
}

/* 0 only if no |z| is above the threshold. See suspects.c for the error of the product in float: at most
   (n + 4) 2^-23 sum_a |V_ai| u_a |w_a| with x = D (D w), which by Cauchy and Schwarz is at most the root of chi-square
   times that of P_ii with all gauges. 1e-5 of the limit covers all rounding in double. */
EVERYWHERE int may_exceed(Estimator *e, double threshold, const Level *low, const Level *high) {
    const size_t n = e->map.n_gauges;
    ScaledStep *step = &e->scaled.step;
    const double chi_square = step->chi_square;
    if (!(chi_square <= LARGEST_SCREENED) || chi_square > e->output[CHI_SQUARE_LIMIT]) {
        return 1;
    }
    for (size_t a = 0; a < n; a++) {
        step->narrow[a] = (float)step->x[a];
    }
    narrow_times(e->wide, n, n, e->scaled.screen, step->narrow, step->narrow_z);
    set_bound(n, low, high, step->ratio * step->ratio, step->bound);
    const double error = (double)(n + 4) * 0x1p-23 * sqrt(chi_square);
    return any_above(n, step->narrow_z, low->margin, step->bound, error, threshold * threshold * (1.0 - 1e-5));
}

#if HAS_AVX2
AVX2 static int may_exceed_avx2(Estimator *e, double threshold, const Level *low, const Level *high) {
    return may_exceed(e, threshold, low, high);
}
#endif

/* P_ii of gauge i with others lost: what is left of D V_i outside the span of D V_R. */
static double precision_without(Estimator *e, size_t gauge) {
    const size_t n = e->map.n_gauges;
    const ScaledStep *step = &e->scaled.step;
    const double *whitening = e->map.form.whitening + gauge * n;
    double *column = e->scaled.work[1];
    for (size_t a = 0; a < n; a++) {
        column[a] = sqrt(step->unresolved[a]) * whitening[a];
    }
    householder_forward(n, step->n_lost, step->matrix, step->head, column);
    return dot(n - step->n_lost, column + step->n_lost, column + step->n_lost);
}

void scaled_standardised_residuals(Estimator *e, double *z) {
    const size_t n = e->map.n_gauges;
    const MaskedMap *m = e->masked;
    const ScaledStep *step = &e->scaled.step;
    double *slope = e->scaled.step.scratch[0], *precisions = e->scaled.step.scratch[1];
    dense_times(e->wide, n, n, e->scaled.columns, step->x, slope);
    if (step->n_lost == 0) {
        dense_times(e->wide, n, n, e->scaled.square, step->unresolved, precisions);
    }
    for (size_t k = 0; k < m->n_used; k++) {
        const size_t gauge = m->used[k];
        const double precision = step->n_lost == 0 ? precisions[gauge] : precision_without(e, gauge);
        const int checked = precision > e->map.form.min_precision[gauge];
        z[gauge] = checked ? slope[gauge] / sqrt(precision) : 0.0;
    }
}

void set_scaled_suspects(Estimator *e, double threshold, const Level *low, const Level *high) {
    const MaskedMap *m = e->masked;
    if (!CHOSEN(e->wide, may_exceed)(e, threshold, low, high)) {
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
