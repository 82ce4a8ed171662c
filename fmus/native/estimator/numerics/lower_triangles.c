/* The root of a covariance and its inverse: C (n, n) = L L', both triangles packed by rows.

   C is scaled to correlations first, C = D c D with the standard deviations D, so that rows of unlike units (gauges,
   auxiliary sensors) cost no digits, and a negative rest is seen relative to 1. By rows (Golub and Van Loan, Matrix
   Computations, section 4.2)

       l_ij = (c_ij - sum over k < j of l_ik l_jk) / l_jj,      l_ii = sqrt(c_ii - sum over k < i of l_ik^2),

   then L = D l and L^-1 = l^-1 D^-1, where row i of l^-1 is the unit row less the rows above times l_ik, over l_ii.
   A rest that is not positive means that C is no covariance: the result is 0. docs/explanation/dynamic_pressure.md,
   "Weights at any dynamic pressure", has L; the same as numpy's cholesky in
   strainfmu/estimator/numerics/whitening.py. */

#include "lower_triangles.h"

#include <math.h>
#include <string.h>

#include "triangles.h"

/* Where the diagonal of a triangle lies in row i. */
static size_t diagonal(size_t i) {
    return triangle_column(i) + i;
}

/* Row i of the root of the covariance scaled to unit variance, with the standard deviations on the diagonal of `size`. */
static int set_row(size_t n, size_t i, const double *covariance, const double *size, double *root) {
    double *row = root + triangle_column(i);
    for (size_t j = 0; j <= i; j++) {
        const double correlation = covariance[i * n + j] / (size[diagonal(i)] * size[diagonal(j)]);
        const double rest = correlation - dot(j, row, root + triangle_column(j));
        if (j < i) {
            row[j] = rest / root[diagonal(j)];
        } else if (rest > 0.0) {
            row[i] = sqrt(rest);
        } else {
            return 0;
        }
    }
    return 1;
}

/* Row i of the inverse, from those above it: the sums run over these, in order. */
static void invert_row(size_t i, const double *row, double *inverse) {
    double *restrict solved = inverse + triangle_column(i);
    memset(solved, 0, i * sizeof *solved);
    for (size_t k = 0; k < i; k++) {
        const double *restrict above = inverse + triangle_column(k);
        for (size_t j = 0; j <= k; j++) {
            solved[j] += row[k] * above[j];
        }
    }
    for (size_t j = 0; j < i; j++) {
        solved[j] = -solved[j] / row[i];
    }
    solved[i] = 1.0 / row[i];
}

/* Rows and columns scaled to unit variance, so that gauges of unlike noise cost no digits. */
int lower_root(size_t n, const double *covariance, double *root, double *inverse) {
    for (size_t i = 0; i < n; i++) {
        const double own = covariance[i * n + i];
        inverse[diagonal(i)] = own > 0.0 ? sqrt(own) : 0.0;
    }
    for (size_t i = 0; i < n; i++) {
        if (!(inverse[diagonal(i)] > 0.0) || !set_row(n, i, covariance, inverse, root)) {
            return 0;
        }
    }
    for (size_t i = 0; i < n; i++) {
        invert_row(i, root + triangle_column(i), inverse);
    }
    for (size_t i = 0; i < n; i++) {
        const double size = sqrt(covariance[i * n + i]);
        for (size_t j = 0; j <= i; j++) {
            root[triangle_column(i) + j] *= size;
        }
    }
    for (size_t j = 0; j < n; j++) {
        const double size = sqrt(covariance[j * n + j]);
        for (size_t i = j; i < n; i++) {
            inverse[triangle_column(i) + j] /= size;
        }
    }
    return 1;
}
