#include "products.h"

#include "blocks.h"

/* Columns j to j + width. */
EVERYWHERE void some_columns(Shape shape, size_t j, size_t width, size_t rows, size_t inner, Strided left,
                             const double *right, size_t right_row, double *product, size_t product_row) {
    const size_t first = shape == LOWER ? j : 0, end = shape == UPPER ? j + width : inner;
    const Strided part = {left.value + first * left.column, left.row, left.column};
    strip(SET, rows, width, end - first, part, right + first * right_row + j, right_row, product, product + j,
          product_row);
}

EVERYWHERE void whole_of(size_t width, Shape shape, size_t rows, size_t inner, size_t columns, Strided left,
                         const double *right, size_t right_row, double *product, size_t product_row) {
    size_t j = 0;
    for (; j + width <= columns; j += width) {
        some_columns(shape, j, width, rows, inner, left, right, right_row, product, product_row);
    }
    for (; j < columns; j += LANES) {
        some_columns(shape, j, LANES, rows, inner, left, right, right_row, product, product_row);
    }
}

EVERYWHERE void upper_of(size_t width, size_t n, size_t inner, Strided left, const double *right, const double *added,
                         double *product) {
    size_t j = 0;
    for (; j + width <= n; j += width) {
        strip(ADD, j + width, width, inner, left, right + j, n, added + j, product + j, n);
    }
    for (; j < n; j += LANES) {
        strip(ADD, j + LANES, LANES, inner, left, right + j, n, added + j, product + j, n);
    }
}

EVERYWHERE void less_of(size_t width, size_t rows, size_t inner, size_t columns, Strided left, const double *right,
                        size_t row, double *product) {
    size_t j = 0;
    for (; j + width <= columns; j += width) {
        strip(SUBTRACT, rows, width, inner, left, right + j, row, product + j, product + j, row);
    }
    for (; j < columns; j += LANES) {
        strip(SUBTRACT, rows, LANES, inner, left, right + j, row, product + j, product + j, row);
    }
}

EVERYWHERE void both(size_t count, double a, const double *restrict x, double b, const double *restrict y,
                     double *restrict out) {
    for (size_t i = 0; i < count; i += LANES) {
        for (size_t r = i; r < i + LANES; r++) {
            out[r] = a * x[r] + b * y[r];
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

EVERYWHERE void subtract(size_t rows, size_t count, const double *restrict factor, const double *restrict y,
                         double *restrict x) {
    for (size_t k = 0; k < rows; k++) {
        for (size_t i = 0; i < count; i += LANES) {
            for (size_t r = i; r < i + LANES; r++) {
                x[k * count + r] -= factor[r] * y[k * count + r];
            }
        }
    }
}

static void whole(Shape shape, size_t rows, size_t inner, size_t columns, Strided left, const double *right,
                  size_t right_row, double *product, size_t product_row) {
    whole_of(NARROW_COLUMNS, shape, rows, inner, columns, left, right, right_row, product, product_row);
}

static void upper(size_t n, size_t inner, Strided left, const double *right, const double *added, double *product) {
    upper_of(NARROW_COLUMNS, n, inner, left, right, added, product);
}

static void less(size_t rows, size_t inner, size_t columns, Strided left, const double *right, size_t row,
                 double *product) {
    less_of(NARROW_COLUMNS, rows, inner, columns, left, right, row, product);
}

#if HAS_AVX2
AVX2 static void whole_avx2(Shape shape, size_t rows, size_t inner, size_t columns, Strided left, const double *right,
                            size_t right_row, double *product, size_t product_row) {
    whole_of(BLOCK_COLUMNS, shape, rows, inner, columns, left, right, right_row, product, product_row);
}

AVX2 static void upper_avx2(size_t n, size_t inner, Strided left, const double *right, const double *added,
                            double *product) {
    upper_of(BLOCK_COLUMNS, n, inner, left, right, added, product);
}

AVX2 static void less_avx2(size_t rows, size_t inner, size_t columns, Strided left, const double *right, size_t row,
                           double *product) {
    less_of(BLOCK_COLUMNS, rows, inner, columns, left, right, row, product);
}

AVX2 static void both_avx2(size_t count, double a, const double *x, double b, const double *y, double *out) {
    both(count, a, x, b, y, out);
}

AVX2 static void sums_of_avx2(size_t rows, size_t count, const double *x, const double *y, double *sums) {
    sums_of(rows, count, x, y, sums);
}

AVX2 static void subtract_avx2(size_t rows, size_t count, const double *factor, const double *y, double *x) {
    subtract(rows, count, factor, y, x);
}
#endif

void multiply(int wide, Shape shape, size_t rows, size_t inner, size_t columns, Strided left, const double *right,
              size_t right_row, double *product, size_t product_row) {
    CHOSEN(wide, whole)(shape, rows, inner, columns, left, right, right_row, product, product_row);
}

void multiply_upper(int wide, size_t n, size_t inner, Strided left, const double *right, const double *added,
                    double *product) {
    CHOSEN(wide, upper)(n, inner, left, right, added, product);
}

void subtract_product(int wide, size_t rows, size_t inner, size_t columns, Strided left, const double *right,
                      size_t row, double *product) {
    CHOSEN(wide, less)(rows, inner, columns, left, right, row, product);
}

void combine(int wide, size_t count, double a, const double *x, double b, const double *y, double *out) {
    CHOSEN(wide, both)(count, a, x, b, y, out);
}

void sum_of_products(int wide, size_t rows, size_t count, const double *x, const double *y, double *sums) {
    CHOSEN(wide, sums_of)(rows, count, x, y, sums);
}

void subtract_products(int wide, size_t rows, size_t count, const double *factor, const double *y, double *x) {
    CHOSEN(wide, subtract)(rows, count, factor, y, x);
}
