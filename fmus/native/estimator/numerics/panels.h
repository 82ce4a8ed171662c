/* Products with triangles in every step, laid out for registers.

   A panel is PANEL rows of a triangle, or columns: PANEL elements lie together for each input, and the PANEL sums stay
   in registers from the first input to the last. What the triangle lacks is zero. On x86-64 the same code is compiled
   twice, for SSE2 and for AVX2; each sum takes its terms in the same order, so that neither the one nor the other nor
   any other processor changes a bit of it. */

#ifndef PANELS_H
#define PANELS_H

#include <stddef.h>

#define PANEL 16

/* n rounded up to whole panels. */
static inline size_t panel_length(size_t n) {
    return (n + PANEL - 1) / PANEL * PANEL;
}

/* Maximum number of elements that the panels of a triangle of order n take: those of rows, or of columns. */
static inline size_t panel_elements(size_t n) {
    return panel_length(n) * (panel_length(n) + PANEL) / 2;
}

/* Whether the processor and the system have AVX2: 1, or 2 with AVX-512, too. */
int panels_wide(void);

/* Lay out a packed upper triangle R (triangles.h) of order n by rows, and by columns. */
void panels_of_rows(size_t n, const double *upper, double *panels);
void panels_of_columns(size_t n, const double *upper, double *panels);

/* y = R x of panels of rows, and y = R' x of panels of columns, for finite x; y has panel_length(n) elements. The
   columns of R are added from left to right, its rows from top to bottom. */
void panels_times(int wide, size_t n, const double *panels, const double *x, double *y);
void panels_transposed_times(int wide, size_t n, const double *panels, const double *x, double *y);

/* Lay out by columns, in float, a packed upper triangle with each column k times scale[k]. Return 1; 0, and nothing is
   laid out, if a column is then longer than 1 by more than round-off. */
int panels_of_screen(size_t n, const double *upper, const double *scale, float *panels);

/* Whether some |element| of R' x is above the limit, for such panels. */
int panels_exceed(int wide, size_t n, const float *panels, const float *x, float limit);

#endif
