/* y = M x for matrices that are the same in every step, laid out in panels of ROWS rows; in double, and in float for
   the screen.

   A panel has the ROWS elements of a column next to each other: a step of the inner loop loads one number of x for
   all of them, and ROWS sums stay in registers. Column k adds to part k % DEPTH of each sum, and the parts are added
   as (0 + 1) + (2 + 3), so that an addition need not wait for the last one and every instruction set gives the same
   bits. Rows and columns beyond the matrix are zeros. docs/developers/native.md, "Cost". */

#include "dense.h"

#include "wide.h"

void dense_panels(size_t rows, size_t columns, const double *source, size_t row_stride, size_t column_stride,
                  double *panels) {
    for (size_t first = 0; first < rows; first += ROWS) {
        for (size_t k = 0; k < dense_columns(columns); k++) {
            for (size_t r = first; r < first + ROWS; r++) {
                *panels++ = r < rows && k < columns ? source[r * row_stride + k * column_stride] : 0.0;
            }
        }
    }
}

void narrow_panels(size_t rows, size_t columns, const double *source, size_t row_stride, size_t column_stride,
                   const double *scale, float *panels) {
    for (size_t first = 0; first < rows; first += NARROW_ROWS) {
        for (size_t k = 0; k < dense_columns(columns); k++) {
            for (size_t r = first; r < first + NARROW_ROWS; r++) {
                *panels++ = r < rows && k < columns ? (float)(source[r * row_stride + k * column_stride] * scale[r]) : 0.0f;
            }
        }
    }
}

EVERYWHERE void product(size_t rows, size_t columns, const double *restrict panel, const double *restrict x,
                        double *restrict y) {
    for (size_t first = 0; first < rows; first += ROWS) {
        double a[ROWS] = {0.0}, b[ROWS] = {0.0}, c[ROWS] = {0.0}, d[ROWS] = {0.0};
        for (size_t k = 0; k < columns; k += DEPTH, panel += DEPTH * ROWS) {
            for (size_t r = 0; r < ROWS; r++) {
                a[r] += panel[r] * x[k];
                b[r] += panel[ROWS + r] * x[k + 1];
                c[r] += panel[2 * ROWS + r] * x[k + 2];
                d[r] += panel[3 * ROWS + r] * x[k + 3];
            }
        }
        for (size_t r = 0; r < ROWS; r++) {
            y[first + r] = (a[r] + b[r]) + (c[r] + d[r]);
        }
    }
}

EVERYWHERE void narrow_product(size_t rows, size_t columns, const float *restrict panel, const float *restrict x,
                               float *restrict y) {
    for (size_t first = 0; first < rows; first += NARROW_ROWS) {
        float a[NARROW_ROWS] = {0.0f}, b[NARROW_ROWS] = {0.0f}, c[NARROW_ROWS] = {0.0f}, d[NARROW_ROWS] = {0.0f};
        for (size_t k = 0; k < columns; k += DEPTH, panel += DEPTH * NARROW_ROWS) {
            for (size_t r = 0; r < NARROW_ROWS; r++) {
                a[r] += panel[r] * x[k];
                b[r] += panel[NARROW_ROWS + r] * x[k + 1];
                c[r] += panel[2 * NARROW_ROWS + r] * x[k + 2];
                d[r] += panel[3 * NARROW_ROWS + r] * x[k + 3];
            }
        }
        for (size_t r = 0; r < NARROW_ROWS; r++) {
            y[first + r] = (a[r] + b[r]) + (c[r] + d[r]);
        }
    }
}

FOR_AVX2(product, (size_t rows, size_t columns, const double *panels, const double *x, double *y),
         (rows, columns, panels, x, y))
FOR_AVX2(narrow_product, (size_t rows, size_t columns, const float *panels, const float *x, float *y),
         (rows, columns, panels, x, y))

void dense_times(int wide, size_t rows, size_t columns, const double *panels, const double *x, double *y) {
    CHOSEN(wide, product)(rows, columns, panels, x, y);
}

void dense_times_many(int wide, size_t rows, size_t columns, const double *panels, size_t count, const double *x,
                      size_t x_apart, double *y, size_t y_apart) {
    for (size_t first = 0; first < rows; first += ROWS) {
        for (size_t j = 0; j < count; j++) {
            dense_times(wide, ROWS, columns, panels + first * dense_columns(columns), x + j * x_apart, y + j * y_apart + first);
        }
    }
}

void narrow_times(int wide, size_t rows, size_t columns, const float *panels, const float *x, float *y) {
    CHOSEN(wide, narrow_product)(rows, columns, panels, x, y);
}
