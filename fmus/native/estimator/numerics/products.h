/* Products of matrices by rows. Every sum runs over its terms in order, on every processor. wide as for wide.h. */

#ifndef PRODUCTS_H
#define PRODUCTS_H

#include "strided.h"

/* Whether the right factor, square then, is zero above its diagonal. */
typedef enum { FULL, LOWER } Shape;

/* product (rows, columns) = left (rows, inner) right (inner, columns). Columns are a multiple of LANES, rows of right
   and product lie right_row and product_row apart. */
void multiply(int wide, Shape shape, size_t rows, size_t inner, size_t columns, Strided left, const double *right,
              size_t right_row, double *product, size_t product_row);

/* product (rows, columns) -= left (rows, inner) right (inner, columns). Columns are a multiple of LANES. */
void subtract_product(int wide, size_t rows, size_t inner, size_t columns, Strided left, const double *right,
                      size_t right_row, double *product, size_t product_row);

#endif
