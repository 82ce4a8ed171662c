/* The filter over time: averages of the estimates of single samples, for the linear and the nonlinear estimator.

   It has one channel for each number that is averaged. docs/explanation/filter.md describes it. */

#ifndef FILTER_H
#define FILTER_H

#include "../sample/sample.h"

/* The channels: loads and coefficients as they are put out, the flight state of a map with tables, then loads and coefficients
   in addition to the five. */
enum { LOAD_CHANNELS = 0, COEFFICIENT_CHANNELS = N_LOADS, STATE_CHANNELS = 2 * N_LOADS };

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

/* What a step leaves to the next one, in addition to the arrays; all of it float64, as serialised. */
typedef struct {
    double stepped;  /* whether the outputs are of a step that has been taken, 0 or 1 */
    double n_spans;  /* of windows */
    double clock;    /* time of its samples [s], which steps longer than the longest do not move further */
    double time;     /* of the last sample that was taken [s] */
    double now;      /* of the sample that follows [s] */
    double has_last; /* whether there is a filtered sample, 0 or 1 */
} FilterTrack;

/* Part "filter" of map.bin: bounds of the time constant [s], the part of the variance of air data that averages out,
   the variance nu_g of each gauge's noise, standard deviations of the rates of (M, u, w, ln p_inf) [1/s] while no
   strain comes. docs/explanation/filter.md, "Model" and "What does not fit". */
typedef struct {
    MAP_MEMBERS(FILTER)
} FilterMap;

typedef struct {
    int present; /* whether the map has one; if not, nothing else is set */
    FilterMap map;
    size_t channels, n_zeros, n_held, n_row;
    FilterTrack track;
    Windows windows;
    int may_move;      /* whether zeros and settings may be others than the samples' before: of derivatives */
    double *kept;      /* (n_kept) what is serialised: held, last, windows; the next point into it */
    size_t n_kept;
    double *held;      /* (n_held) zeros, their sigmas, 0 where none has one; references and moment point of the samples */
    double *last_value, *last_variance, *last_rate; /* (channels) of the last filtered sample, and its rates [1/s] */
    /* The sample at hand: */
    double *value, *variance, *noise; /* (channels) of the estimate of it alone; the last: what averages out */
    double *mean, *left, *factor;     /* (channels) filtered; the variance, and the sigma over the sample's alone */
    double *rate;
    double *latest; /* (n_held) */
    double *row;    /* (n_row) scratch of the noise */
    double part_left;                 /* of the variance of noise [1]; 1 where nothing is averaged */
    int is_sample, is_filtered, coasts; /* whether there is one; whether the outputs are filtered, or go on without strain */
} Filter;

/* Read the part, if there is one, and allocate for so many channels and doubles of scratch. 1; 0 after a message. */
int filter_create(MapFile *file, const Inputs *inputs, size_t channels, size_t scratch, Filter *filter);

/* Forget all samples. */
void filter_reset(Filter *filter);

/* Filter filter->value, variance and noise: the sample at hand, with these zeros, by windows of at most a time [s]. 0, and
   there is no sample, where they are no numbers to calculate with. */
int filter_sample(Filter *filter, const Inputs *inputs, double time_constant);

/* Note that no sample is filtered, as where the filter is off. */
void filter_without(Filter *filter);

/* There is no sample. Time since the last one that was filtered with the same zeros and settings [s]; negative for none. */
double filter_no_sample(Filter *filter, const Inputs *inputs);

/* The sample at hand is one before the next, at a time [s]. */
void filter_take_next(Filter *filter, double time);

/* Covariances of filtered channels, from the covariances (count, count) of the sample alone. */
static inline void scale_covariance(size_t count, const double *factor, double *covariance) {
    for (size_t i = 0; i < count; i++) {
        for (size_t j = 0; j < count; j++) {
            covariance[i * count + j] *= factor[i] * factor[j];
        }
    }
}

/* The state; whether such bytes may be read. */
size_t filter_state_size(const Filter *filter);
void filter_write_state(const Filter *filter, unsigned char *bytes);
int filter_state_fits(const Filter *filter, const unsigned char *bytes);
void filter_read_state(Filter *filter, const unsigned char *bytes);

#endif
