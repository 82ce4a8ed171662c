/* The zeros that a window of readings gives, and what speaks against them. */

#ifndef TARE_JUDGE_H
#define TARE_JUDGE_H

#include <stddef.h>

#include "../map/container.h"

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

/* Hand out the arrays. */
void window_arrays(TareWindow *window, size_t n_gauges, Room *room);

/* Begin without readings. */
void window_begin(TareWindow *window);

/* Take the readings of one time; NaN where there is none. */
void window_add(TareWindow *window, const double *strain);

/* Whether counts can be of a window. */
int window_counts_fit(const WindowCounts *counts);

void window_statistics(const TareWindow *window, double least_part, WindowStatistics *statistics);

#define GAUGES_PER_PATTERN 4 /* that read, at least: with fewer any zeros look like load */

enum { TARE_IDLE, TARE_AVERAGING, TARE_DONE, TARE_REFUSED };

/* Why zeros are not to be used: bits. */
enum {
    TARE_NO_PRESSURE = 1,  /* the dynamic pressure of a step is not known */
    TARE_PRESSURE = 2,     /* it is above its limit */
    TARE_SHORT = 4,        /* too few samples; nothing else is judged */
    TARE_DRIFTS = 8,       /* a gauge rises by more than its limit */
    TARE_MOVES = 16,       /* a gauge scatters by far more than its noise */
    TARE_TOO_LARGE = 32,   /* a reading that is no plausible zero */
    TARE_LIKE_LOAD = 64,   /* readings have the pattern of a flight */
    TARE_FEW_GAUGES = 128  /* too few gauges read */
};

/* Of the map; the arrays point into the bytes of the file. */
typedef struct {
    MAP_MEMBERS(TARE)
} TareLimits;

/* What is serialised, as float64, with the arrays of the zeros and of the window behind it. */
typedef struct {
    double state, is_up; /* is_up: the input at the last step */
    double has_zeros;    /* whether a tare has set zeros */
} TareFlags;

/* What a window was found to be. Gauges are counted from 1; strain is [1]. */
typedef struct {
    double faults; /* sum of the bits */
    double samples;
    double memory;                            /* factor on standard deviations by which readings depend on each other */
    double gauges, rms, largest_std;          /* gauges that have a zero; rms of the zeros, their largest sigma */
    double dynamic_pressure, samples_without; /* the largest one [Pa] or the step's; samples without one */
    double drifting_gauge, drift;             /* the largest rise over the window that is one */
    double moving_gauge, scatter;             /* the largest by the noise of the gauge */
    double largest_gauge, largest;            /* the largest reading less known strain */
    double along, along_limit;                /* root of the sum of squares along strain of flights, and of random zeros */
} TareVerdict;

typedef struct {
    int present; /* whether the map has the part; if not, nothing else is set */
    size_t n_gauges;
    double largest_zero; /* [1] */
    TareLimits limits;
    int up;      /* the input */
    TareFlags flags;
    double *zero; /* (2 n_gauges + 1) of a tare: zeros, standard deviations, the common one [1]; the window follows */
    TareWindow window;
    WindowStatistics statistics;
    double *judged; /* (2 n_gauges + 1) zeros of the last window, also of one that is refused */
    TareVerdict verdict;
    double *reading, *scratch;
    int to_report; /* whether there is an outcome in text that was not reported */
    char text[MODEL_TEXT_SIZE];
} Tare;

/* Number of doubles of its scratch. */
size_t judge_doubles(size_t n_gauges, size_t n_patterns);

/* Set tare->judged and tare->verdict from tare->statistics; all that speaks against the zeros is in the verdict. A gauge
   that does not read gets 0 with the largest standard deviation there is. */
void tare_judge(Tare *tare);

#endif
