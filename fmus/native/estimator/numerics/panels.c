#include "panels.h"

#include <math.h>
#include <string.h>

#include "triangles.h"
#include "wide.h"

#if HAS_AVX2
#include <cpuid.h>

/* Intel, Software Developer's Manual, volume 1, sections 14.7 and 15.2: AVX2, and an operating system that saves ymm;
   AVX-512, and one that saves zmm. Processors with VBMI2 do not slow down for the latter. */
int panels_wide(void) {
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
int panels_wide(void) {
    return 0;
}
#endif

static size_t smaller(size_t a, size_t b) {
    return a < b ? a : b;
}

void panels_of_rows(size_t n, const double *upper, double *panels) {
    for (size_t first = 0; first < n; first += PANEL) {
        for (size_t j = first; j < n; j++, panels += PANEL) {
            const size_t rows = smaller(j - first + 1, PANEL);
            memset(panels, 0, PANEL * sizeof *panels);
            memcpy(panels, upper + triangle_column(j) + first, rows * sizeof *panels);
        }
    }
}

void panels_of_columns(size_t n, const double *upper, double *panels) {
    for (size_t first = 0; first < n; first += PANEL) {
        for (size_t i = 0; i < smaller(first + PANEL, n); i++) {
            for (size_t j = first; j < first + PANEL; j++) {
                *panels++ = j < n && i <= j ? upper[triangle_column(j) + i] : 0.0;
            }
        }
    }
}

int panels_of_screen(size_t n, const double *upper, const double *scale, float *panels) {
    for (size_t j = 0; j < n; j++) {
        double sum = 0.0;
        for (size_t i = 0; i <= j; i++) {
            const double element = upper[triangle_column(j) + i] * scale[j];
            sum += element * element;
        }
        if (!(sum < 1.01)) {
            return 0;
        }
    }
    for (size_t first = 0; first < n; first += PANEL) {
        for (size_t i = 0; i < smaller(first + PANEL, n); i++) {
            for (size_t j = first; j < first + PANEL; j++) {
                *panels++ = j < n && i <= j ? (float)(upper[triangle_column(j) + i] * scale[j]) : 0.0f;
            }
        }
    }
    return 1;
}

/* One panel's PANEL sums over `count` inputs. */
EVERYWHERE void sum_panel(size_t count, const double *restrict panel, const double *restrict x, double *restrict y) {
    double sum[PANEL] = {0.0};
    for (size_t k = 0; k < count; k++, panel += PANEL) {
        for (size_t r = 0; r < PANEL; r++) {
            sum[r] += panel[r] * x[k];
        }
    }
    memcpy(y, sum, sizeof sum);
}

EVERYWHERE void rows_times(size_t n, const double *panels, const double *x, double *y) {
    for (size_t first = 0; first < n; first += PANEL) {
        sum_panel(n - first, panels, x + first, y + first);
        panels += (n - first) * PANEL;
    }
}

EVERYWHERE void columns_times(size_t n, const double *panels, const double *x, double *y) {
    for (size_t first = 0; first < n; first += PANEL) {
        const size_t end = first + PANEL < n ? first + PANEL : n;
        sum_panel(end, panels, x, y + first);
        panels += end * PANEL;
    }
}

EVERYWHERE int columns_exceed(size_t n, const float *restrict panels, const float *restrict x, float limit) {
    int above = 0;
    for (size_t first = 0; first < n; first += PANEL) {
        const size_t end = first + PANEL < n ? first + PANEL : n;
        float sum[PANEL] = {0.0f};
        for (size_t i = 0; i < end; i++, panels += PANEL) {
            for (size_t c = 0; c < PANEL; c++) {
                sum[c] += panels[c] * x[i];
            }
        }
        for (size_t c = 0; c < PANEL; c++) {
            above |= fabsf(sum[c]) > limit;
        }
    }
    return above;
}

#if HAS_AVX2
AVX2 static void rows_times_avx2(size_t n, const double *panels, const double *x, double *y) {
    rows_times(n, panels, x, y);
}

AVX2 static void columns_times_avx2(size_t n, const double *panels, const double *x, double *y) {
    columns_times(n, panels, x, y);
}

AVX2 static int columns_exceed_avx2(size_t n, const float *panels, const float *x, float limit) {
    return columns_exceed(n, panels, x, limit);
}
#endif

void panels_times(int wide, size_t n, const double *panels, const double *x, double *y) {
    CHOSEN(wide, rows_times)(n, panels, x, y);
}

void panels_transposed_times(int wide, size_t n, const double *panels, const double *x, double *y) {
    CHOSEN(wide, columns_times)(n, panels, x, y);
}

int panels_exceed(int wide, size_t n, const float *panels, const float *x, float limit) {
    return CHOSEN(wide, columns_exceed)(n, panels, x, limit);
}
