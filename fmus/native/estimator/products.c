#include "products.h"

#include "flight_tables.h"
#include "wide.h"

#define BLOCK_ROWS 4
#define BLOCK_COLUMNS 8

/* A block of BLOCK_ROWS rows, or of one, over BLOCK_COLUMNS columns, or LANES: constants where it is called, so that the
   sums stay in registers. */
EVERYWHERE void block(size_t rows, size_t columns, size_t inner, const double *restrict left, size_t row, size_t column,
                      const double *restrict right, size_t right_row, double *restrict product, size_t product_row) {
    double sum[BLOCK_ROWS][BLOCK_COLUMNS];
    for (size_t i = 0; i < rows; i++) {
        for (size_t j = 0; j < columns; j++) {
            sum[i][j] = 0.0;
        }
    }
    for (size_t k = 0; k < inner; k++) {
        const double *restrict b = right + k * right_row;
        for (size_t i = 0; i < rows; i++) {
            const double a = left[i * row + k * column];
            for (size_t j = 0; j < columns; j++) {
                sum[i][j] += a * b[j];
            }
        }
    }
    for (size_t i = 0; i < rows; i++) {
        for (size_t j = 0; j < columns; j++) {
            product[i * product_row + j] = sum[i][j];
        }
    }
}

/* All rows over a block of columns. */
EVERYWHERE void strip(size_t rows, size_t columns, size_t inner, const double *left, size_t row, size_t column,
                      const double *right, size_t right_row, double *product, size_t product_row) {
    size_t i = 0;
    for (; i + BLOCK_ROWS <= rows; i += BLOCK_ROWS) {
        block(BLOCK_ROWS, columns, inner, left + i * row, row, column, right, right_row, product + i * product_row,
              product_row);
    }
    for (; i < rows; i++) {
        block(1, columns, inner, left + i * row, row, column, right, right_row, product + i * product_row, product_row);
    }
}

/* `lower`: the first rows of a block of columns of right, above its diagonal, are zero. */
EVERYWHERE void all_columns(int lower, size_t rows, size_t inner, size_t columns, Strided left, const double *right,
                            size_t right_row, double *product, size_t product_row) {
    size_t j = 0;
    for (; j + BLOCK_COLUMNS <= columns; j += BLOCK_COLUMNS) {
        const size_t first = lower ? j : 0;
        strip(rows, BLOCK_COLUMNS, inner - first, left.value + first * left.column, left.row, left.column,
              right + first * right_row + j, right_row, product + j, product_row);
    }
    for (; j < columns; j += LANES) {
        const size_t first = lower ? j : 0;
        strip(rows, LANES, inner - first, left.value + first * left.column, left.row, left.column,
              right + first * right_row + j, right_row, product + j, product_row);
    }
}

EVERYWHERE void whole(size_t rows, size_t inner, size_t columns, Strided left, const double *right, size_t right_row,
                      double *product, size_t product_row) {
    all_columns(0, rows, inner, columns, left, right, right_row, product, product_row);
}

EVERYWHERE void lower(size_t rows, size_t columns, Strided left, const double *right, size_t right_row, double *product,
                      size_t product_row) {
    all_columns(1, rows, columns, columns, left, right, right_row, product, product_row);
}

#if HAS_AVX2
AVX2 static void whole_avx2(size_t rows, size_t inner, size_t columns, Strided left, const double *right,
                            size_t right_row, double *product, size_t product_row) {
    whole(rows, inner, columns, left, right, right_row, product, product_row);
}

AVX2 static void lower_avx2(size_t rows, size_t columns, Strided left, const double *right, size_t right_row,
                            double *product, size_t product_row) {
    lower(rows, columns, left, right, right_row, product, product_row);
}
#endif

void multiply(int wide, size_t rows, size_t inner, size_t columns, Strided left, const double *right, size_t right_row,
              double *product, size_t product_row) {
    CHOSEN(wide, whole)(rows, inner, columns, left, right, right_row, product, product_row);
}

void multiply_lower(int wide, size_t rows, size_t columns, Strided left, const double *right, size_t right_row,
                    double *product, size_t product_row) {
    CHOSEN(wide, lower)(rows, columns, left, right, right_row, product, product_row);
}
