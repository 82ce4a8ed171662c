/* Products of matrices by rows. Every sum runs over its terms in order, on every processor. wide as for panels.h. */

#ifndef PRODUCTS_H
#define PRODUCTS_H

#include <stddef.h>

/* A matrix whose element (i, k) is value[i * row + k * column]. */
typedef struct {
    const double *value;
    size_t row, column;
} Strided;

/* product (rows, columns) = left (rows, inner) right (inner, columns). Columns are a multiple of LANES, rows of right
   and product lie right_row and product_row apart. */
void multiply(int wide, size_t rows, size_t inner, size_t columns, Strided left, const double *right, size_t right_row,
              double *product, size_t product_row);

/* The same with a lower triangular right (columns, columns), zero right of its diagonal. */
void multiply_lower(int wide, size_t rows, size_t columns, Strided left, const double *right, size_t right_row,
                    double *product, size_t product_row);

#endif
