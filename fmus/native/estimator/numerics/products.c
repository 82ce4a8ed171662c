#include "products.h"

#include "blocks.h"

/* Rows of a lower triangular factor: LANES of them reach LANES columns further than those above. */
EVERYWHERE void lower_strip(size_t rows, size_t width, Strided left, const double *right, size_t right_row,
                            double *product, size_t product_row) {
    for (size_t i = 0; i < rows; i += LANES) {
        block(SET, LANES, width, i + LANES, left.value + i * left.row, left.row, left.column, right, right_row,
              product + i * product_row, product + i * product_row, product_row);
    }
}

/* Columns j to j + width. */
EVERYWHERE void some_columns(Shape shape, size_t j, size_t width, size_t rows, size_t inner, Strided left,
                             const double *right, size_t right_row, double *product, size_t product_row) {
    const size_t first = shape == LOWER ? j : 0, end = shape == UPPER ? j + width : inner;
    const Strided part = {left.value + first * left.column, left.row, left.column};
    if (shape == LOWER_LEFT) {
        lower_strip(rows, width, left, right + j, right_row, product + j, product_row);
        return;
    }
    strip(SET, rows, width, end - first, part, right + first * right_row + j, right_row, product, product + j,
          product_row);
}

/* What is zero of a triangular right factor has no place for wide blocks. */
EVERYWHERE void whole_of(size_t width, Shape shape, size_t rows, size_t inner, size_t columns, Strided left,
                         const double *right, size_t right_row, double *product, size_t product_row) {
    size_t j = 0;
#define SOME_COLUMNS(count) some_columns(shape, j, count, rows, inner, left, right, right_row, product, product_row)
    BY_COLUMNS(j, columns, width, shape == FULL || shape == LOWER_LEFT, SOME_COLUMNS)
#undef SOME_COLUMNS
}

EVERYWHERE void upper_of(size_t width, size_t n, size_t row, size_t inner, Strided left, const double *right,
                         const double *added, double *product) {
    size_t j = 0;
#define SOME_COLUMNS(count) strip(ADD, j + count, count, inner, left, right + j, row, added + j, product + j, row)
    BY_COLUMNS(j, n, width, 0, SOME_COLUMNS)
#undef SOME_COLUMNS
}

/* All rows, or those that the upper triangle has. */
EVERYWHERE void change_of(size_t width, Change change, int is_upper, size_t rows, size_t inner, size_t columns,
                          Strided left, const double *right, size_t right_row, double *product, size_t product_row) {
    size_t j = 0;
#define SOME_COLUMNS(count) \
    strip(change, is_upper && j + count < rows ? j + count : rows, count, inner, left, right + j, right_row, \
          product + j, product + j, product_row)
    BY_COLUMNS(j, columns, width, !is_upper, SOME_COLUMNS)
#undef SOME_COLUMNS
}

EVERYWHERE void both_of(size_t count, double a, const double *restrict x, double b, const double *restrict y,
                        double *restrict out) {
    for (size_t i = 0; i < count; i += LANES) {
        for (size_t r = 0; r < LANES; r++) {
            out[i + r] = a * x[i + r] + b * y[i + r];
        }
    }
}

EVERYWHERE void sums_of(size_t rows, size_t count, const double *restrict x, const double *restrict y,
                        double *restrict sums) {
    for (size_t i = 0; i < count; i += LANES) {
        double sum[LANES] = {0.0};
        for (size_t k = 0; k < rows; k++) {
            for (size_t r = 0; r < LANES; r++) {
                sum[r] += x[k * count + i + r] * y[k * count + i + r];
            }
        }
        for (size_t r = 0; r < LANES; r++) {
            sums[i + r] = sum[r];
        }
    }
}

EVERYWHERE void squares_of(size_t width, size_t n, size_t j, const double *restrict lower, double *restrict squares) {
    double sum[4 * LANES] = {0.0};
    for (size_t i = j; i < n; i++) {
        for (size_t r = 0; r < width; r++) {
            sum[r] += lower[i * n + j + r] * lower[i * n + j + r];
        }
    }
    for (size_t r = 0; r < width; r++) {
        squares[j + r] = sum[r];
    }
}

EVERYWHERE void all_squares(size_t n, const double *restrict lower, double *restrict squares) {
    size_t j = 0;
    for (; j + 2 * LANES <= n; j += 2 * LANES) {
        squares_of(2 * LANES, n, j, lower, squares);
    }
    for (; j < n; j += LANES) {
        squares_of(LANES, n, j, lower, squares);
    }
}

/* The same for an instruction set, in blocks of so many columns. */
#define PRODUCTS(instructions, set, width) \
    instructions static void whole##set(Shape shape, size_t rows, size_t inner, size_t columns, Strided left, \
                                        const double *right, size_t right_row, double *product, size_t product_row) { \
        whole_of(width, shape, rows, inner, columns, left, right, right_row, product, product_row); \
    } \
    instructions static void upper##set(size_t n, size_t row, size_t inner, Strided left, const double *right, \
                                        const double *added, double *product) { \
        upper_of(width < BLOCK_COLUMNS ? width : BLOCK_COLUMNS, n, row, inner, left, right, added, product); \
    } \
    instructions static void more##set(int is_upper, size_t rows, size_t inner, size_t columns, Strided left, \
                                       const double *right, size_t right_row, double *product, size_t product_row) { \
        change_of(width, ADD, is_upper, rows, inner, columns, left, right, right_row, product, product_row); \
    } \
    instructions static void less##set(int is_upper, size_t rows, size_t inner, size_t columns, Strided left, \
                                       const double *right, size_t right_row, double *product, size_t product_row) { \
        change_of(width, SUBTRACT, is_upper, rows, inner, columns, left, right, right_row, product, product_row); \
    } \
    instructions static void both##set(size_t count, double a, const double *x, double b, const double *y, double *out) { \
        both_of(count, a, x, b, y, out); \
    } \
    instructions static void total##set(size_t rows, size_t count, const double *x, const double *y, double *out) { \
        sums_of(rows, count, x, y, out); \
    } \
    instructions static void columns##set(size_t n, const double *lower, double *out) { \
        all_squares(n, lower, out); \
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

void multiply_upper(int wide, size_t n, size_t row, size_t inner, Strided left, const double *right,
                    const double *added, double *product) {
    WIDEST(wide, upper)(n, row, inner, left, right, added, product);
}

void add_product(int wide, size_t rows, size_t inner, size_t columns, Strided left, const double *right, size_t right_row,
                 double *product, size_t product_row) {
    WIDEST(wide, more)(0, rows, inner, columns, left, right, right_row, product, product_row);
}

void subtract_product(int wide, size_t rows, size_t inner, size_t columns, Strided left, const double *right,
                      size_t right_row, double *product, size_t product_row) {
    WIDEST(wide, less)(0, rows, inner, columns, left, right, right_row, product, product_row);
}

void add_upper(int wide, size_t rows, size_t inner, size_t columns, Strided left, const double *right, size_t right_row,
               double *product, size_t product_row) {
    WIDEST(wide, more)(1, rows, inner, columns, left, right, right_row, product, product_row);
}

void subtract_upper(int wide, size_t rows, size_t inner, size_t columns, Strided left, const double *right,
                    size_t right_row, double *product, size_t product_row) {
    WIDEST(wide, less)(1, rows, inner, columns, left, right, right_row, product, product_row);
}

void column_squares(int wide, size_t n, const double *lower, double *squares) {
    WIDEST(wide, columns)(n, lower, squares);
}

void combine(int wide, size_t count, double a, const double *x, double b, const double *y, double *out) {
    WIDEST(wide, both)(count, a, x, b, y, out);
}

void sum_of_products(int wide, size_t rows, size_t count, const double *x, const double *y, double *sums) {
    WIDEST(wide, total)(rows, count, x, y, sums);
}
