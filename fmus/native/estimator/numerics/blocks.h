/* Blocks of a product of matrices by rows, whose sums stay in registers; for cholesky.c and what needs a product of its
   own. Every sum runs over its terms in order. */

#ifndef BLOCKS_H
#define BLOCKS_H

#include "lanes.h"
#include "wide.h"

/* A matrix by rows, by columns, or a part of either: its element (i, k) is value[i * row + k * column]. */
typedef struct {
    const double *value;
    size_t row, column;
} Strided;

/* One whose rows are `row` apart. */
static inline Strided by_rows(const double *value, size_t row) {
    return (Strided){value, row, 1};
}
#define MOST_ROWS 5
#define BLOCK_COLUMNS 8
#define WIDE_COLUMNS 24 /* with AVX-512, for which loading a number of the left factor into all lanes takes longest */
#define NARROW_COLUMNS (HAS_AVX2 ? LANES : BLOCK_COLUMNS) /* without AVX2, of which x86-64 has half the registers */

/* some(count) from row i on, for all rows. One that is left over joins the last block, which a single one would cost as
   much as. */
#define BY_ROWS(i, rows, some) \
    for (; i + 4 <= rows && i + MOST_ROWS != rows; i += 4) { \
        some(4); \
    } \
    if (i + MOST_ROWS == rows) { \
        some(MOST_ROWS); \
        i = rows; \
    } \
    if (i + 2 <= rows) { \
        some(2); \
        i += 2; \
    } \
    if (i < rows) { \
        some(1); \
    }

/* some(count) from column j on, for all columns, in blocks of `width`, a constant, at most: of BLOCK_COLUMNS at most
   unless wide. */
#define BY_COLUMNS(j, columns, width, wide, some) \
    for (; width > BLOCK_COLUMNS && (wide) && j + width <= columns; j += width) { \
        some(width); \
    } \
    for (; width >= BLOCK_COLUMNS && j + BLOCK_COLUMNS <= columns; j += BLOCK_COLUMNS) { \
        some(BLOCK_COLUMNS); \
    } \
    for (; j < columns; j += LANES) { \
        some(LANES); \
    }

/* What a product becomes: itself, or what was there before without it. */
typedef enum { SET, SUBTRACT } Change;

/* Rows and columns are constants where it is called, as the change is. `before` lies as the product does. */
EVERYWHERE void block(Change change, size_t rows, size_t columns, size_t inner, const double *restrict left, size_t row,
                      size_t column, const double *restrict right, size_t right_row, const double *before,
                      double *product, size_t product_row) {
    double sum[MOST_ROWS][WIDE_COLUMNS];
    for (size_t i = 0; i < rows; i++) {
        for (size_t j = 0; j < columns; j++) {
            sum[i][j] = change == SET ? 0.0 : before[i * product_row + j];
        }
    }
    for (size_t k = 0; k < inner; k++) {
        const double *restrict b = right + k * right_row;
        for (size_t i = 0; i < rows; i++) {
            const double a = left[i * row + k * column];
            for (size_t j = 0; j < columns; j++) {
                sum[i][j] = change == SUBTRACT ? sum[i][j] - a * b[j] : sum[i][j] + a * b[j];
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
EVERYWHERE void strip(Change change, size_t rows, size_t columns, size_t inner, Strided left, const double *right,
                      size_t right_row, const double *before, double *product, size_t product_row) {
    size_t i = 0;
#define SOME_ROWS(count) \
    block(change, count, columns, inner, left.value + i * left.row, left.row, left.column, right, right_row, \
          before + i * product_row, product + i * product_row, product_row)
    BY_ROWS(i, rows, SOME_ROWS)
#undef SOME_ROWS
}

#endif
