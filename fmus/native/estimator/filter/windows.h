/* Means and straight lines over the last samples: the longest windows that agree with all shorter ones. */

#ifndef WINDOWS_H
#define WINDOWS_H

#include "../numerics/memory.h"

#define MOST_SPANS 40 /* up to 2^20 samples in one */

/* Samples of a span: their number, the mean of their times [s], the sum of squares about it. */
typedef struct {
    double count, time, spread;
} Span;

/* By channel: mean, sum of products of time and value about their means, mean variance of the noise. */
typedef struct {
    Span span;
    double *value, *product, *noise; /* (channels) */
} Sums;

typedef struct {
    size_t channels, n_spans;
    Span span[MOST_SPANS];           /* the oldest first */
    double *value, *product, *noise; /* (MOST_SPANS, channels), as Sums has them */
    /* Scratch. */
    Sums sums;                /* of a window */
    double *low[2], *high[2]; /* (channels) what is common to the intervals of means, of lines */
} Windows;

/* Hand out the arrays: first the three that are kept; channels is set. */
void windows_arrays(Windows *windows, Room *room);

/* Where a sample of values and variances of their noise (channels) at a time [s] stands, by windows of at most `longest`
   [s]: its mean, the variance of the noise in it, and the rates [1/s]. The part of the noise's variance that is left; 1, and
   values and noise are the sample's, where nothing longer agrees. */
double windows_look(Windows *windows, double time, double longest, const double *value, const double *noise, double *mean,
                    double *left, double *rate);

/* Take the sample in. */
void windows_take(Windows *windows, double time, const double *value, const double *noise);

#endif
