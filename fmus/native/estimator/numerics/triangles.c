/* Small dense algebra of the linear map: sums, Householder decompositions, triangular solutions.

   A (rows, columns) = Q R by Householder reflections H_k = 1 - f v v' (Golub and Van Loan, Matrix Computations,
   section 5.2). Column k below row k - 1, of norm a and first element x, is reflected to -sign(x) a in row k:

       v = column - (-sign(x) a) e_1,      f = 1 / (a (a + |x|)) = 2 / v' v,

   without cancellation, as v_1 has the sign of x. v stays below the diagonal, f and v_1 in `head`, so that Q' x =
   H_last .. H_0 x and Q x = H_0 .. H_last x can be formed later. A column of zeros is not reflected, its R has a
   zero on the diagonal.

   Lost gauges (update/lost_rows.c), the complement of the states (update/added_noise.c) and the gauges in use
   (update/prepared.c) are all such decompositions. Columns are taken in pairs, which share the loads of v; each
   sum has the order of dot. docs/explanation/theory.md, "Missing and suspect gauges". */

#include "triangles.h"

#include <math.h>
#include <string.h>

double dot(size_t n, const double *restrict x, const double *restrict y) {
    return sum_of_products(n, x, y);
}

/* The same for two at once, each in the order of dot. */
EVERYWHERE void dot_two(size_t n, const double *restrict x, const double *restrict y, const double *restrict z,
                        double *with_y, double *with_z) {
    double first[LANES] = {0.0}, second[LANES] = {0.0};
    size_t i = 0;
    for (; i + LANES <= n; i += LANES) {
        for (size_t r = 0; r < LANES; r++) {
            first[r] += x[i + r] * y[i + r];
            second[r] += x[i + r] * z[i + r];
        }
    }
    *with_y = (first[0] + first[1]) + (first[2] + first[3]);
    *with_z = (second[0] + second[1]) + (second[2] + second[3]);
    for (; i < n; i++) {
        *with_y += x[i] * y[i];
        *with_z += x[i] * z[i];
    }
}

/* Reflect column k so that it ends in row k, and all columns after it. Return the factor of the reflection, 0 for none;
   *head takes the first element of its vector, the others stay below the diagonal. */
EVERYWHERE double reflect(size_t rows, size_t k, size_t columns, double *a, double *head) {
    double *restrict v = a + k * rows + k;
    const size_t length = rows - k;
    const double norm = sqrt(dot(length, v, v));
    *head = 0.0;
    if (!(norm > 0.0)) {
        return 0.0;
    }
    const double first = v[0];
    const double diagonal = first > 0.0 ? -norm : norm;
    const double factor = 1.0 / (norm * (norm + fabs(first)));
    size_t j = k + 1;
    v[0] = first - diagonal;
    for (; j + 2 <= columns; j += 2) {
        double *one = a + j * rows + k, *other = one + rows, along_one, along_other;
        dot_two(length, v, one, other, &along_one, &along_other);
        add_times(length, -factor * along_one, v, one);
        add_times(length, -factor * along_other, v, other);
    }
    if (j < columns) {
        double *last = a + j * rows + k;
        add_times(length, -factor * dot(length, v, last), v, last);
    }
    *head = v[0];
    v[0] = diagonal;
    return factor;
}

/* Reflect columns up to, not including, `pivots`; head (2 pivots) takes what householder_back needs besides a. */
EVERYWHERE void reflections(size_t rows, size_t pivots, size_t columns, double *a, double *head) {
    for (size_t k = 0; k < pivots; k++) {
        double first;
        const double factor = reflect(rows, k, columns, a, &first);
        if (head != NULL) {
            head[2 * k] = factor;
            head[2 * k + 1] = first;
        }
    }
}

FOR_AVX2(reflections, (size_t rows, size_t pivots, size_t columns, double *a, double *head),
         (rows, pivots, columns, a, head))

void householder_triangle(int wide, size_t rows, size_t columns, double *a) {
    CHOSEN(wide, reflections)(rows, rows < columns ? rows : columns, columns, a, NULL);
}

void householder_columns(int wide, size_t rows, size_t pivots, size_t columns, double *a, double *head) {
    CHOSEN(wide, reflections)(rows, pivots, columns, a, head);
}

/* x = H x for the reflection of column k. */
EVERYWHERE void apply_reflection(size_t rows, size_t k, const double *a, const double *head, double *x) {
    const double *v = a + k * rows + k;
    const size_t rest = rows - k - 1;
    const double projection = head[2 * k] * (head[2 * k + 1] * x[k] + dot(rest, v + 1, x + k + 1));
    x[k] -= projection * head[2 * k + 1];
    for (size_t i = 0; i < rest; i++) {
        x[k + 1 + i] -= projection * v[1 + i];
    }
}

void householder_forward(size_t rows, size_t pivots, const double *a, const double *head, double *x) {
    for (size_t k = 0; k < pivots; k++) {
        apply_reflection(rows, k, a, head, x);
    }
}

EVERYWHERE void back(size_t rows, size_t pivots, const double *a, const double *head, double *x) {
    size_t last = rows; /* reflections below it change nothing */
    while (last > 0 && x[last - 1] == 0.0) {
        last--;
    }
    for (size_t k = pivots < last ? pivots : last; k-- > 0;) {
        apply_reflection(rows, k, a, head, x);
    }
}

FOR_AVX2(back, (size_t rows, size_t pivots, const double *a, const double *head, double *x), (rows, pivots, a, head, x))

void householder_back(int wide, size_t rows, size_t pivots, const double *a, const double *head, double *x) {
    CHOSEN(wide, back)(rows, pivots, a, head, x);
}

void solve_triangle(size_t rows, size_t n, const double *a, double *x) {
    for (size_t j = n; j-- > 0;) {
        const double *column = a + j * rows;
        x[j] /= column[j];
        for (size_t i = 0; i < j; i++) {
            x[i] -= column[i] * x[j];
        }
    }
}

void solve_transposed(size_t rows, size_t n, const double *a, double *x) {
    for (size_t j = 0; j < n; j++) {
        const double *column = a + j * rows;
        for (size_t i = 0; i < j; i++) {
            x[j] -= column[i] * x[i];
        }
        x[j] /= column[j];
    }
}

/* The root of a covariance and its inverse: C (n, n) = L L', both triangles packed by rows.

   C is scaled to correlations first, C = D c D with the standard deviations D, so that rows of unlike units (gauges,
   auxiliary sensors) cost no digits, and a negative rest is seen relative to 1. By rows (Golub and Van Loan, Matrix
   Computations, section 4.2)

       l_ij = (c_ij - sum over k < j of l_ik l_jk) / l_jj,      l_ii = sqrt(c_ii - sum over k < i of l_ik^2),

   then L = D l and L^-1 = l^-1 D^-1, where row i of l^-1 is the unit row less the rows above times l_ik, over l_ii.
   A rest that is not positive means that C is no covariance: the result is 0. docs/explanation/dynamic_pressure.md,
   "Weights at any dynamic pressure", has L. */

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
