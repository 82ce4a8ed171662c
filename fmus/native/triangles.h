/* Small dense linear algebra, in an order of operations that is the same on every platform.

   A packed upper triangle of order n holds its columns one after another, rows 0 .. j of column j: element (i, j) is
   at j (j + 1) / 2 + i. Other matrices are stored by columns. No function allocates. */

#ifndef TRIANGLES_H
#define TRIANGLES_H

#include <stddef.h>

/* Place of the first element of column j. */
static inline size_t triangle_column(size_t j) {
    return j * (j + 1) / 2;
}

/* Place of the diagonal element of row i in a triangle stored by rows. */
static inline size_t triangle_row(size_t n, size_t i) {
    return i * n - i * (i + 1) / 2 + i;
}

/* y = R x for a packed upper triangle R of order n. */
void triangle_times(size_t n, const double *upper, const double *x, double *y);

/* y = R' x for the same triangle stored by rows: row i holds columns i .. n - 1. */
void triangle_transposed_times(size_t n, const double *rows, const double *x, double *y);

/* Store by rows a triangle that is packed by columns. */
void triangle_rows(size_t n, const double *upper, double *rows);

/* Sum of x[i] y[i] over n elements. */
double dot(size_t n, const double *x, const double *y);

/* Replace the upper triangle of a (rows x columns, by columns) by the R of a = Q R; what lies below is scratch.
   Householder reflections: Golub & Van Loan, Matrix Computations, section 5.2. */
void householder_triangle(size_t rows, size_t columns, double *a);

/* The smallest singular value of a (n x n, by columns), which is overwritten. One-sided Jacobi rotations, which find
   small singular values to full relative accuracy: Demmel & Veselic, SIAM J. Matrix Anal. Appl. 13 (1992). */
double smallest_singular_value(size_t n, double *a);

#endif
