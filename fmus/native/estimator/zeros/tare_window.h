/* Readings of a window in few numbers: means of stretches of equal length, which separate noise from drift.

   A window of n readings falls into stretches of L = 2^k readings each, so that 16 to 31 of them are whole; an even
   number of those counts. What does not fill them joins the mean and the scatter alone. So a longer window needs no
   more room.

   Numbers are about the first reading of each gauge: zeros are up to 10^5 times the noise. */

#ifndef TARE_WINDOW_H
#define TARE_WINDOW_H

#include <stddef.h>

#define LEAST_STRETCHES 16
#define MAX_STRETCHES (2 * LEAST_STRETCHES)

/* Numbers of readings, of readings of a stretch, of whole stretches, of readings of the next one: whole numbers, as they
   are serialised. */
typedef struct {
    double samples, length, stretches, filled;
} WindowCounts;

/* All arrays are float64; they follow each other, first to count. */
typedef struct {
    size_t n_gauges;
    WindowCounts counts;
    double *first;  /* (n_gauges) first reading of each gauge, 0 before it [1] */
    double *square; /* (n_gauges) sum of squares of the readings less the first */
    double *total;  /* (MAX_STRETCHES, n_gauges) sums of the same by stretches */
    double *count;  /* (MAX_STRETCHES, n_gauges) their numbers */
} TareWindow;

/* What the readings show, for gauges that read in a part of them at least; 0 for others. */
typedef struct {
    size_t n_stretches;   /* an even number */
    unsigned char *reads; /* (n_gauges) */
    double *mean;         /* (n_gauges) [1] */
    double *scatter;      /* (n_gauges) standard deviation of one reading [1] */
    double *stretch;      /* (n_stretches, n_gauges) means less the first reading [1] */
} WindowStatistics;

/* Number of doubles of the arrays of a window. */
size_t window_doubles(size_t n_gauges);

/* Let the arrays be those at `doubles`. */
void window_arrays(TareWindow *window, size_t n_gauges, double *doubles);

/* Begin without readings. */
void window_begin(TareWindow *window);

/* Take the readings of one time; NaN where there is none. */
void window_add(TareWindow *window, const double *strain);

/* Whether counts can be of a window. */
int window_counts_fit(const WindowCounts *counts);

void window_statistics(const TareWindow *window, double least_part, WindowStatistics *statistics);

#endif
