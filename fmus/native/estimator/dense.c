#include "dense.h"

#include "wide.h"

void dense_panels(size_t rows, size_t columns, const double *source, size_t row_stride, size_t column_stride,
                  double *panels) {
    for (size_t first = 0; first < rows; first += ROWS) {
        for (size_t k = 0; k < columns; k++) {
            for (size_t r = first; r < first + ROWS; r++) {
                *panels++ = r < rows ? source[r * row_stride + k * column_stride] : 0.0;
            }
        }
    }
}

void narrow_panels(size_t rows, size_t columns, const double *source, size_t row_stride, size_t column_stride,
                   const double *scale, float *panels) {
    for (size_t first = 0; first < rows; first += NARROW_ROWS) {
        for (size_t k = 0; k < columns; k++) {
            for (size_t r = first; r < first + NARROW_ROWS; r++) {
                *panels++ = r < rows ? (float)(source[r * row_stride + k * column_stride] * scale[r]) : 0.0f;
            }
        }
    }
}

EVERYWHERE void product(size_t rows, size_t columns, const double *restrict panel, const double *restrict x,
                        double *restrict y) {
    for (size_t first = 0; first < rows; first += ROWS) {
        double sum[DEPTH][ROWS] = {{0.0}};
        size_t k = 0;
        for (; k + DEPTH <= columns; k += DEPTH, panel += DEPTH * ROWS) {
            for (size_t part = 0; part < DEPTH; part++) {
                for (size_t r = 0; r < ROWS; r++) {
                    sum[part][r] += panel[part * ROWS + r] * x[k + part];
                }
            }
        }
        for (; k < columns; k++, panel += ROWS) {
            for (size_t r = 0; r < ROWS; r++) {
                sum[0][r] += panel[r] * x[k];
            }
        }
        for (size_t r = 0; r < ROWS; r++) {
            y[first + r] = (sum[0][r] + sum[1][r]) + (sum[2][r] + sum[3][r]);
        }
    }
}

EVERYWHERE void narrow_product(size_t rows, size_t columns, const float *restrict panel, const float *restrict x,
                               float *restrict y) {
    for (size_t first = 0; first < rows; first += NARROW_ROWS) {
        float sum[DEPTH][NARROW_ROWS] = {{0.0f}};
        size_t k = 0;
        for (; k + DEPTH <= columns; k += DEPTH, panel += DEPTH * NARROW_ROWS) {
            for (size_t part = 0; part < DEPTH; part++) {
                for (size_t r = 0; r < NARROW_ROWS; r++) {
                    sum[part][r] += panel[part * NARROW_ROWS + r] * x[k + part];
                }
            }
        }
        for (; k < columns; k++, panel += NARROW_ROWS) {
            for (size_t r = 0; r < NARROW_ROWS; r++) {
                sum[0][r] += panel[r] * x[k];
            }
        }
        for (size_t r = 0; r < NARROW_ROWS; r++) {
            y[first + r] = (sum[0][r] + sum[1][r]) + (sum[2][r] + sum[3][r]);
        }
    }
}

#if HAS_AVX2
AVX2 static void product_avx2(size_t rows, size_t columns, const double *panels, const double *x, double *y) {
    product(rows, columns, panels, x, y);
}

AVX2 static void narrow_product_avx2(size_t rows, size_t columns, const float *panels, const float *x, float *y) {
    narrow_product(rows, columns, panels, x, y);
}
#endif

void dense_times(int wide, size_t rows, size_t columns, const double *panels, const double *x, double *y) {
    CHOSEN(wide, product)(rows, columns, panels, x, y);
}

void narrow_times(int wide, size_t rows, size_t columns, const float *panels, const float *x, float *y) {
    CHOSEN(wide, narrow_product)(rows, columns, panels, x, y);
}
