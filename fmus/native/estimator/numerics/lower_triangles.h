/* Lower triangles, packed by rows: element (i, j), j <= i, is at i (i + 1) / 2 + j. */

#ifndef LOWER_TRIANGLES_H
#define LOWER_TRIANGLES_H

#include <stddef.h>

/* L and L^-1 of a covariance (n, n) = L L'. 0 if it is none. */
int lower_root(size_t n, const double *covariance, double *root, double *inverse);

#endif
