/* Dense algebra of the flight state's solution: one Cholesky decomposition, and what is solved with it.

   Matrices of order n, a multiple of LANES; L lies by columns, n apart, and is right on and below its diagonal. Sums
   take LANES terms at once, in one order on every processor. wide as for wide.h. */

#ifndef CHOLESKY_H
#define CHOLESKY_H

#include <stddef.h>

/* Replace the lower triangle of a positive definite matrix (n, n) by L, matrix = L L'. */
void cholesky(int wide, size_t n, double *matrix);

/* x = L^-1 x for `count` vectors, n apart. */
void solve_lower(int wide, size_t n, const double *lower, size_t count, double *x);

/* x = L'^-1 x for `count` vectors, n apart. */
void solve_upper(int wide, size_t n, const double *lower, size_t count, double *x);

/* L^-1 (n, n) by rows; of what lies right of the diagonal's LANES, the next LANES are 0, others are not set. scratch
   takes (LANES, n). */
void invert_lower(int wide, size_t n, const double *lower, double *scratch, double *inverse);

/* y = L'^-1 x for N_TURNED vectors, n apart, and the sums of squares (n) of the columns of L^-1. */
#define N_TURNED 5
void turn_back(int wide, size_t n, const double *inverse, const double *x, double *y, double *squares);

/* Sums of x[i] y[i] over n elements, in LANES parts, of every pair of N_TURNED vectors, n apart. */
void lane_products(int wide, size_t n, const double *x, double products[N_TURNED][N_TURNED]);

/* The inverse (order, order) of a symmetric positive definite matrix of at most 5 rows, and its product with a vector. */
void invert_small(size_t order, const double *matrix, double *inverse);

/* x' M x of a symmetric matrix, and x' M y. */
double quadratic(size_t order, const double *x, const double *matrix, const double *y);

static inline double larger(double a, double b) {
    return b > a ? b : a;
}

/* value, or the end of the range that it leaves. */
static inline double clipped(double value, double low, double high) {
    return value < low ? low : value > high ? high : value;
}

#endif
