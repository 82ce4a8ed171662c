/* y = M x for matrices that are the same in every step, laid out in panels of ROWS rows; in double, and in float for
   the screen.

   A panel has the ROWS elements of a column next to each other: a step of the inner loop loads one number of x for
   all of them, and ROWS sums stay in registers. Column k adds to part k % DEPTH of each sum, and the parts are added
   as (0 + 1) + (2 + 3), so that an addition need not wait for the last one and every instruction set gives the same
   bits. Rows and columns beyond the matrix are zeros. docs/developers/native.md, "Cost". */

#include "numerics.h"

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

/* The product in numbers of a type, for panels of so many rows. */
#define PRODUCT(name, Number, HEIGHT) \
    EVERYWHERE void name(size_t rows, size_t columns, const Number *restrict panel, const Number *restrict x, \
                         Number *restrict y) { \
        for (size_t first = 0; first < rows; first += HEIGHT) { \
            Number a[HEIGHT] = {0}, b[HEIGHT] = {0}, c[HEIGHT] = {0}, d[HEIGHT] = {0}; \
            for (size_t k = 0; k < columns; k += DEPTH, panel += DEPTH * HEIGHT) { \
                for (size_t r = 0; r < HEIGHT; r++) { \
                    a[r] += panel[r] * x[k]; \
                    b[r] += panel[HEIGHT + r] * x[k + 1]; \
                    c[r] += panel[2 * HEIGHT + r] * x[k + 2]; \
                    d[r] += panel[3 * HEIGHT + r] * x[k + 3]; \
                } \
            } \
            for (size_t r = 0; r < HEIGHT; r++) { \
                y[first + r] = (a[r] + b[r]) + (c[r] + d[r]); \
            } \
        } \
    }

PRODUCT(product, double, ROWS)
PRODUCT(narrow_product, float, NARROW_ROWS)

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

/* Which instruction sets the processor and the operating system have: 0 for SSE2 or none of x86, 1 for AVX2, 2 for
   AVX-512.

   The answer chooses between compiled variants of the same sums (numerics.h): no result depends on it.
   docs/developers/native.md, "Cost". */

#if HAS_AVX2
#include <cpuid.h>

/* Intel, Software Developer's Manual, volume 1, sections 14.7 and 15.2: AVX2, and an operating system that saves ymm;
   AVX-512, and one that saves zmm. Processors with VBMI2 do not slow down for the latter. */
int wide_of_processor(void) {
    const unsigned needed = bit_AVX512F | bit_AVX512DQ | bit_AVX512BW | bit_AVX512VL;
    unsigned a, b, c, d, saved, high;
    if (!__get_cpuid(1, &a, &b, &c, &d) || !(c & bit_OSXSAVE) || !(c & bit_AVX)) {
        return 0;
    }
    __asm__("xgetbv" : "=a"(saved), "=d"(high) : "c"(0));
    if ((saved & 0x6u) != 0x6u || !__get_cpuid_count(7, 0, &a, &b, &c, &d) || !(b & bit_AVX2)) {
        return 0;
    }
    return (saved & 0xe6u) == 0xe6u && (b & needed) == needed && (c & bit_AVX512VBMI2) ? 2 : 1;
}
#else
int wide_of_processor(void) {
    return 0;
}
#endif
