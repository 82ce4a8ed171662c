/* Products of matrices by rows. Every sum runs over its terms in order, on every processor. wide as for wide.h. */

#ifndef PRODUCTS_H
#define PRODUCTS_H

#include "strided.h"

/* Which elements of the right factor are zero; or of the left one, square and lower triangular. */
typedef enum { FULL, LOWER, UPPER, LOWER_LEFT } Shape;

/* product (rows, columns) = left (rows, inner) right (inner, columns). Columns are a multiple of LANES, rows of right
   and product lie right_row and product_row apart. A right factor that is lower or upper triangular is square. */
void multiply(int wide, Shape shape, size_t rows, size_t inner, size_t columns, Strided left, const double *right,
              size_t right_row, double *product, size_t product_row);

/* The upper triangle of product (n, n) = added + left (n, inner) right (inner, n), and some of what lies left of it. n is
   a multiple of LANES; rows of the last three lie `row` apart. */
void multiply_upper(int wide, size_t n, size_t row, size_t inner, Strided left, const double *right,
                    const double *added, double *product);

/* product (rows, columns) += or -= left (rows, inner) right (inner, columns). Columns are a multiple of LANES. */
void add_product(int wide, size_t rows, size_t inner, size_t columns, Strided left, const double *right, size_t right_row,
                 double *product, size_t product_row);
void subtract_product(int wide, size_t rows, size_t inner, size_t columns, Strided left, const double *right,
                      size_t right_row, double *product, size_t product_row);

/* The same for the upper triangle of a product, and some of what lies left of it; rows <= columns. */
void add_upper(int wide, size_t rows, size_t inner, size_t columns, Strided left, const double *right, size_t right_row,
               double *product, size_t product_row);
void subtract_upper(int wide, size_t rows, size_t inner, size_t columns, Strided left, const double *right,
                    size_t right_row, double *product, size_t product_row);

/* Sums of squares (n) of the columns of a lower triangular matrix (n, n) with zeros in the LANES right of its own. */
void column_squares(int wide, size_t n, const double *lower, double *squares);

/* out = a x + b y for `count` elements, a multiple of LANES. */
void combine(int wide, size_t count, double a, const double *x, double b, const double *y, double *out);

/* sums = sum over `rows` rows of x y, each of `count` elements, a multiple of LANES. */
void sum_of_products(int wide, size_t rows, size_t count, const double *x, const double *y, double *sums);

#endif
