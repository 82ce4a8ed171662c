/* Products of matrices by rows: P = A B and P -= A B, sums in registers.

   The columns of P are taken in blocks whose sums stay in registers (blocks.h): 24 columns with AVX-512, 4 with
   SSE2, 8 with AVX2 and elsewhere. A sum runs over the inner index in order, in one part, so that no width of a
   block changes a bit. A lower triangular B has zeros above its diagonal: a block of columns from j on begins with
   row j. Both are the bulk of a nonlinear step (cholesky.c). docs/developers/native.md, "Cost". */

#include "products.h"

#include "blocks.h"

/* Columns j to j + width of P; a lower triangular B begins at row j. */
EVERYWHERE void some_columns(Shape shape, size_t j, size_t width, size_t rows, size_t inner, Strided left,
                             const double *right, size_t right_row, double *product, size_t product_row) {
    const size_t first = shape == LOWER ? j : 0;
    const Strided part = {left.value + first * left.column, left.row, left.column};
    strip(SET, rows, width, inner - first, part, right + first * right_row + j, right_row, product, product + j,
          product_row);
}

/* All columns of A B. Wide blocks would multiply the zeros of a triangle. */
EVERYWHERE void whole_of(size_t width, Shape shape, size_t rows, size_t inner, size_t columns, Strided left,
                         const double *right, size_t right_row, double *product, size_t product_row) {
    size_t j = 0;
#define SOME_COLUMNS(count) some_columns(shape, j, count, rows, inner, left, right, right_row, product, product_row)
    BY_COLUMNS(j, columns, width, shape == FULL, SOME_COLUMNS)
#undef SOME_COLUMNS
}

/* All columns of P - A B. */
EVERYWHERE void less_of(size_t width, size_t rows, size_t inner, size_t columns, Strided left, const double *right,
                        size_t right_row, double *product, size_t product_row) {
    size_t j = 0;
#define SOME_COLUMNS(count) \
    strip(SUBTRACT, rows, count, inner, left, right + j, right_row, product + j, product + j, product_row)
    BY_COLUMNS(j, columns, width, 1, SOME_COLUMNS)
#undef SOME_COLUMNS
}

/* The same for an instruction set, in blocks of so many columns. */
#define PRODUCTS(instructions, set, width) \
    instructions static void whole##set(Shape shape, size_t rows, size_t inner, size_t columns, Strided left, \
                                        const double *right, size_t right_row, double *product, size_t product_row) { \
        whole_of(width, shape, rows, inner, columns, left, right, right_row, product, product_row); \
    } \
    instructions static void less##set(size_t rows, size_t inner, size_t columns, Strided left, const double *right, \
                                       size_t right_row, double *product, size_t product_row) { \
        less_of(width, rows, inner, columns, left, right, right_row, product, product_row); \
    }

PRODUCTS(, , NARROW_COLUMNS)
#if HAS_AVX2
PRODUCTS(AVX2, _avx2, BLOCK_COLUMNS)
PRODUCTS(AVX512, _avx512, WIDE_COLUMNS)
#endif

void multiply(int wide, Shape shape, size_t rows, size_t inner, size_t columns, Strided left, const double *right,
              size_t right_row, double *product, size_t product_row) {
    WIDEST(wide, whole)(shape, rows, inner, columns, left, right, right_row, product, product_row);
}

void subtract_product(int wide, size_t rows, size_t inner, size_t columns, Strided left, const double *right,
                      size_t right_row, double *product, size_t product_row) {
    WIDEST(wide, less)(rows, inner, columns, left, right, right_row, product, product_row);
}
