/* The gauge that does not fit the others: the largest leave-one-out residual z_i = (P r)_i / sqrt(P_ii).

   All z cost a product of n^2. A screen in float shows first, with a bound of its own error, that no |z| can be
   above the threshold, as in nearly every step; only where it leaves that open are they computed in double. So the
   screen decides about time, never about a result.

       z_i^2 = (V_i' x)^2 / P_ii,    x = u w,    y_i = V_i' x / |V_i| in float,
       z_i^2 <= (|y_i| + error margin_i)^2 bound_i,    bound_i >= |V_i|^2 / P_ii,    margin_i >= sqrt(P_ii) / |V_i|.

   bound and margin belong to the interval of the pressure ratio (update/current_errors.c). Gauges whose residuals
   always move together cannot be distinguished and are named together: groups of update/masked_map.c.
   docs/explanation/theory.md, "Missing and suspect gauges"; docs/explanation/alarm_levels.md has the thresholds. */

#include "suspects.h"

#include <math.h>
#include <string.h>

#include "../numerics/dense.h"
#include "../numerics/wide.h"
#include "../update/scaled_form.h"

/* |w|^2 up to which float holds w and the products with it. */
#define LARGEST_SCREENED 0x1p40

/* Whether some |z| may be above the limit. z^2 = (V_i' x)^2 / P_ii, where y = V_i' x / |V_i| was found in float and is wrong
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

/* 0 only if no |z| is above the threshold, found in float in a fraction of the time that z takes.

   Let u = 2^-24. Rounding V_i and x to float, multiplying and adding n terms in any order is wrong by at most (n + 2) u
   |V_i|' |x| to first order (Higham, Accuracy and Stability of Numerical Algorithms, section 3.1). Twice that covers the
   second order (n <= 4096). With x = D (D w) it is at most (n + 4) 2^-23 sum_a |V_ai| u_a |w_a|, which by Cauchy and
   Schwarz is at most the root of chi-square times the root of P_ii with all gauges. 1e-5 of the limit covers all rounding in
   double. By the same inequality no z^2 is above chi-square: a small chi-square needs no products. Where chi-square
   shows a fault, some |z| is above as a rule: nothing would be gained. */
EVERYWHERE int may_exceed(Linear *linear, double threshold) {
    const size_t n = linear->map->n_gauges;
    ScaledStep *step = &linear->scaled.step;
    const double chi_square = step->chi_square, limit = threshold * threshold * (1.0 - 1e-5);
    if (chi_square <= limit) {
        return 0;
    }
    if (!(chi_square <= LARGEST_SCREENED) || chi_square > linear->output[CHI_SQUARE_LIMIT]) {
        return 1;
    }
    const Interval *interval = step->interval;
    if (!(step->n_lost == 0 ? interval->bounded : step->bounded)) {
        return 1;
    }
    const double *bound = step->n_lost == 0 ? interval->bound : step->bound;
    for (size_t a = 0; a < n; a++) {
        step->narrow[a] = (float)step->x[a];
    }
    narrow_times(linear->wide, n, n, linear->scaled.screen, step->narrow, step->narrow_z);
    const double error = (double)(n + 4) * 0x1p-23 * sqrt(chi_square);
    return any_above(n, step->narrow_z, interval->margin, bound, error, limit);
}

#if HAS_AVX2
AVX2 static int may_exceed_avx2(Linear *linear, double threshold) {
    return may_exceed(linear, threshold);
}
#endif

/* Set the outputs for the gauge in use of that index. */
static void name_suspects(Linear *linear, size_t worst) {
    const MaskedMap *m = linear->prepared.masked;
    size_t suspects = 0;
    for (size_t k = 0; k < m->n_used; k++) {
        suspects += m->group[k] == m->group[worst];
    }
    linear->output[SUSPECT_GAUGE] = (double)(m->used[m->group[worst]] + 1);
    linear->output[SUSPECTS] = (double)suspects;
}

void set_suspects(Linear *linear, double threshold) {
    const MaskedMap *m = linear->prepared.masked;
    if (!CHOSEN(linear->wide, may_exceed)(linear, threshold)) {
        return;
    }
    double *z = linear->scaled.step.z;
    size_t worst = 0;
    double largest = 0.0;
    scaled_standardised_residuals(&linear->scaled, z);
    for (size_t k = 0; k < m->n_used; k++) {
        const double size = fabs(z[m->used[k]]);
        if (size > largest) {
            largest = size;
            worst = k;
        }
    }
    if (largest > threshold) {
        masked_map_groups(linear->map, linear->prepared.masked, &linear->prepared.work);
        name_suspects(linear, worst);
    }
}
