/* What a tare holds: its limits, its window, the zeros that it has found. The limits are part "tare" of resources/map.bin. */

#ifndef TARE_STATE_H
#define TARE_STATE_H

#include "../map/container.h"
#include "tare_window.h"

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

#endif
