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
static int may_exceed(Linear *linear, double threshold) {
    const MaskedMap *m = linear->prepared.masked;
    const double chi_square = linear->output[CHI_SQUARE];
    if (!m->screened || !(chi_square <= LARGEST_SCREENED) || chi_square > linear->output[CHI_SQUARE_LIMIT]) {
        return 1;
    }
    const double margin = (double)(m->n_used + 4) * 0x1p-23 * sqrt(chi_square) + 0x1p-90;
    const double limit = threshold - margin < LARGEST_SCREENED ? threshold - margin : LARGEST_SCREENED;
    for (size_t k = 0; k < m->n_used; k++) {
        linear->absolute.narrow[k] = (float)linear->absolute.whitened[k];
    }
    return panels_exceed(linear->wide, m->n_used, m->screen, linear->absolute.narrow, (float)limit);
}

void name_suspects(Linear *linear, size_t worst) {
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
    if (!may_exceed(linear, threshold)) {
        return;
    }
    absolute_standardised_residuals(linear->wide, m, &linear->absolute);
    if (!scale_and_compare(m->n_used, linear->absolute.z, m->z_scale, threshold)) {
        return;
    }
    size_t worst = 0;
    double largest = fabs(linear->absolute.z[0]);
    for (size_t k = 1; k < m->n_used; k++) {
        if (fabs(linear->absolute.z[k]) > largest) {
            largest = fabs(linear->absolute.z[k]);
            worst = k;
        }
    }
    name_suspects(linear, worst);
}
