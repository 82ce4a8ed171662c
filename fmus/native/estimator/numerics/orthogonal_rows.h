/* Rows turned until they are orthogonal: the left singular vectors of a matrix, applied to it and to what stands behind it.

   First the rows are turned by the eigenvectors of their products: reflections to a tridiagonal matrix, then QL steps with
   implicit shifts (Golub & Van Loan, Matrix Computations, sections 8.3.1 and 8.3.3). That leaves them orthogonal to
   rounding of the largest row. One-sided Jacobi rotations then make them so for their own sizes, in two or three sweeps.
   Every turn is orthogonal: none loses what the others have reached. */

#ifndef ORTHOGONAL_ROWS_H
#define ORTHOGONAL_ROWS_H

#include <stddef.h>

/* Number of doubles of its scratch. */
size_t orthogonal_rows_doubles(size_t count, size_t width);

/* Turn rows (count, width) until their first n elements are orthogonal, row to row. wide as for panels.h. */
void orthogonal_rows(int wide, size_t count, size_t n, size_t width, double *rows, double *scratch);

#endif
