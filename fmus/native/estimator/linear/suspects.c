#include "suspects.h"

#include <math.h>

#include "../numerics/panels.h"

/* |w|^2 up to which float holds w and the products with it. */
#define LARGEST_SCREENED 0x1p40

/* Whether some |z| is above the threshold; z gets its scale. Without branches, for it runs over all of them. */
static int scale_and_compare(size_t n, double *restrict z, const double *restrict scale, double threshold) {
    int above = 0;
    for (size_t k = 0; k < n; k++) {
        z[k] *= scale[k];
        above |= fabs(z[k]) > threshold;
    }
    return above;
}

/* 0 only if no |z_k| is above the threshold, found in float in a fraction of the time that z takes.

   z_k = c_k' w, where c_k, column k of R times z_scale, has length 1 or is 0. Let u = 2^-24. Rounding c_k and w to
   float, multiplying and adding n terms in any order errs by at most (n + 2) u |c_k|' |w| to first order (Higham,
   Accuracy and Stability of Numerical Algorithms, section 3.1), which is at most (n + 2) u |w| by Cauchy and Schwarz.
   The limit in float errs by u times the threshold; that matters only if some |z_k| is above it, and then it is below
   |w|. Twice the sum of both covers the second order (n <= 4096), a length of c_k off by the 1 % that
   panels_of_screen allows, and all rounding in double, which is 2^-29 of it. Elements too small for float, even on a
   host that sets them to zero, lose less than n 2^-126 (1 + |w|) < 2^-90.

   Where chi-square shows a fault, some |z_k| is above as a rule: nothing would be gained. */
static int may_exceed(Estimator *e, double threshold) {
    const MaskedMap *m = e->masked;
    const double chi_square = e->output[CHI_SQUARE];
    if (!m->screened || !(chi_square <= LARGEST_SCREENED) || chi_square > e->output[CHI_SQUARE_LIMIT]) {
        return 1;
    }
    const double margin = (double)(m->n_used + 4) * 0x1p-23 * sqrt(chi_square) + 0x1p-90;
    const double limit = threshold - margin < LARGEST_SCREENED ? threshold - margin : LARGEST_SCREENED;
    for (size_t k = 0; k < m->n_used; k++) {
        e->narrow[k] = (float)e->whitened[k];
    }
    return panels_exceed(e->wide, m->n_used, m->screen, e->narrow, (float)limit);
}

void name_suspects(Estimator *e, size_t worst) {
    const MaskedMap *m = e->masked;
    size_t suspects = 0;
    for (size_t k = 0; k < m->n_used; k++) {
        suspects += m->group[k] == m->group[worst];
    }
    e->output[SUSPECT_GAUGE] = (double)(m->used[m->group[worst]] + 1);
    e->output[SUSPECTS] = (double)suspects;
}

void set_suspects(Estimator *e, double threshold) {
    const MaskedMap *m = e->masked;
    if (!may_exceed(e, threshold)) {
        return;
    }
    panels_transposed_times(e->wide, m->n_used, m->column_panels, e->whitened, e->z);
    if (!scale_and_compare(m->n_used, e->z, m->z_scale, threshold)) {
        return;
    }
    size_t worst = 0;
    double largest = fabs(e->z[0]);
    for (size_t k = 1; k < m->n_used; k++) {
        if (fabs(e->z[k]) > largest) {
            largest = fabs(e->z[k]);
            worst = k;
        }
    }
    name_suspects(e, worst);
}
