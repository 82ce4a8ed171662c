/* Small dense linear algebra, in an order of operations that is the same on every platform.

   A packed upper triangle of order n holds its columns one after another, rows 0 .. j of column j: element (i, j) is
   at j (j + 1) / 2 + i. Other matrices are stored by columns. No function allocates. */

#ifndef TRIANGLES_H
#define TRIANGLES_H

#include <stddef.h>

#include "wide.h"

/* Index of the first element of column j. */
static inline size_t triangle_column(size_t j) {
    return j * (j + 1) / 2;
}

/* Sum of x[i] y[i] over n elements, in LANES parts, so that additions need not wait for each other, added as (0 + 1) +
   (2 + 3); then the rest in order. */
EVERYWHERE double sum_of_products(size_t n, const double *restrict x, const double *restrict y) {
    double part[LANES] = {0.0};
    size_t i = 0;
    for (; i + LANES <= n; i += LANES) {
        for (size_t r = 0; r < LANES; r++) {
            part[r] += x[i + r] * y[i + r];
        }
    }
    double sum = (part[0] + part[1]) + (part[2] + part[3]);
    for (; i < n; i++) {
        sum += x[i] * y[i];
    }
    return sum;
}

/* y += factor x. */
EVERYWHERE void add_times(size_t n, double factor, const double *restrict x, double *restrict y) {
    for (size_t i = 0; i < n; i++) {
        y[i] += factor * x[i];
    }
}

/* The sum by a call. */
double dot(size_t n, const double *x, const double *y);

/* Replace the upper triangle of a (rows x columns, by columns) by the R of a = Q R; what lies below is scratch.
   Householder reflections: Golub & Van Loan, Matrix Computations, section 5.2. wide as for wide.h. */
void householder_triangle(int wide, size_t rows, size_t columns, double *a);

/* The same for the first `pivots` columns of a (rows x columns), pivots <= rows: the other columns become Q' times them.
   head (2 pivots) takes what householder_back needs besides a. */
void householder_columns(int wide, size_t rows, size_t pivots, size_t columns, double *a, double *head);

/* x = Q' x, or x = Q x, for the Q of householder_columns; x has `rows` elements. */
void householder_forward(size_t rows, size_t pivots, const double *a, const double *head, double *x);
void householder_back(int wide, size_t rows, size_t pivots, const double *a, const double *head, double *x);

/* x = R^-1 x, or R'^-1 x, for the R (n x n) at the top of a (rows x n, by columns). */
void solve_triangle(size_t rows, size_t n, const double *a, double *x);
void solve_transposed(size_t rows, size_t n, const double *a, double *x);

/* L and L^-1 of a covariance (n, n) = L L'. 0 if it is none. */
int lower_root(size_t n, const double *covariance, double *root, double *inverse);

/* Rows turned until they are orthogonal: the left singular vectors of a matrix, applied to it and to what stands behind it. */

/* How far rows are turned; all 0 before the first part. */
typedef struct {
    int stage;      /* of the functions in triangles.c, */
    size_t row;     /* the next row in it, */
    int round;      /* QL steps for that row, or sweeps before this one, */
    double largest; /* and the largest |cosine| of the sweep so far */
} Turned;

/* Number of doubles of its scratch. */
size_t orthogonal_rows_doubles(size_t count, size_t width);

/* Turn rows (count, width) until their first n elements are orthogonal, row to row: a part of it, which ends with the
   first row, QL step or row of a sweep that brings its multiplications to `work`. 1 if they are orthogonal. Rows, scratch
   and *turned are the same from part to part, and what comes out does not depend on their number. wide as for wide.h. */
int orthogonal_rows(int wide, size_t count, size_t n, size_t width, double *rows, double *scratch, Turned *turned,
                    size_t work);

/* The smallest singular value of rows (n, n), which are turned; square (n) is scratch. One-sided Jacobi rotations alone, which
   find small singular values to full relative accuracy. */
double smallest_singular_value(size_t n, double *rows, double *square);

#endif
