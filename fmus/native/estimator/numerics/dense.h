/* Products with matrices in every step, laid out for registers.

   A panel is ROWS rows: ROWS elements lie together for each column, the ROWS sums stay in registers, and columns of zeros
   make their number a multiple of DEPTH. Each row is summed in DEPTH parts, column k in part k % DEPTH, which are added at
   the end: the same order on every processor. */

#ifndef DENSE_H
#define DENSE_H

#include <stddef.h>

#define ROWS 8
#define DEPTH 4
#define NARROW_ROWS 16 /* of the panels in float */

static inline size_t dense_rows(size_t rows) {
    return (rows + ROWS - 1) / ROWS * ROWS;
}

static inline size_t dense_columns(size_t columns) {
    return (columns + DEPTH - 1) / DEPTH * DEPTH;
}

static inline size_t narrow_rows(size_t rows) {
    return (rows + NARROW_ROWS - 1) / NARROW_ROWS * NARROW_ROWS;
}

/* Lay out a matrix whose element (r, k) is source[r * row_stride + k * column_stride]; panels has dense_rows(rows) *
   dense_columns(columns) elements. */
void dense_panels(size_t rows, size_t columns, const double *source, size_t row_stride, size_t column_stride,
                  double *panels);

/* The same in float, each row times its scale: narrow_rows(rows) * dense_columns(columns) elements. */
void narrow_panels(size_t rows, size_t columns, const double *source, size_t row_stride, size_t column_stride,
                   const double *scale, float *panels);

/* y = M x; y has dense_rows(rows) elements, x dense_columns(columns), those beyond `columns` being 0. wide as for
   wide.h. */
void dense_times(int wide, size_t rows, size_t columns, const double *panels, const double *x, double *y);

/* y_j = M x_j for `count` vectors, x_j and y_j each `x_apart` and `y_apart` after the one before: a panel stays in the cache
   while it meets all of them. */
void dense_times_many(int wide, size_t rows, size_t columns, const double *panels, size_t count, const double *x,
                      size_t x_apart, double *y, size_t y_apart);

/* The same of one in float; y has narrow_rows(rows) elements. */
void narrow_times(int wide, size_t rows, size_t columns, const float *panels, const float *x, float *y);

/* Whether the processor and the system have AVX2: 1, or 2 with AVX-512, too; for wide.h. */
int wide_of_processor(void);

#endif
