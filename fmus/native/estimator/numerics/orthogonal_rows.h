/* Rows turned until they are orthogonal: the left singular vectors of a matrix, applied to it and to what stands behind it. */

#ifndef ORTHOGONAL_ROWS_H
#define ORTHOGONAL_ROWS_H

#include <stddef.h>

/* How far rows are turned; all 0 before the first part. */
typedef struct {
    int stage;      /* of the functions in orthogonal_rows.c, */
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
