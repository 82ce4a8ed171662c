/* Zero offsets from readings at rest. */

#ifndef ZEROS_H
#define ZEROS_H

#include <stddef.h>

#include "../map/map.h"

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

/* A tare by the edges of the input `tare`, or of a whole window of readings at once. Limits and the strain of flights and of
   known loads are part "tare" of resources/map.bin. */

/* Read the part, if there is one, and allocate. 1; 0 after a message. */
int tare_create(MapFile *file, size_t n_gauges, double largest_zero, Tare *tare);

/* Another tare of the same map, which has not begun; that must live as long. 1; 0 without memory. */
int tare_like(const Tare *other, Memory *memory, Tare *tare);
void tare_reset(Tare *tare);

/* Take in the input at a step or an event; whether there are other zeros now. */
int tare_follow(Tare *tare);

/* Take in tare->reading (n_gauges), NaN for gauges not in use, and the dynamic pressure [Pa], NaN if it is not known. */
void tare_take(Tare *tare, double dynamic_pressure);

/* Whether tare_take is to be called. */
static inline int tare_is_averaging(const Tare *tare) {
    return tare->flags.state == (double)TARE_AVERAGING;
}

/* Judge a window of `count` samples at once: strain (count, n_gauges), dynamic_pressure (count) [Pa], NaN where there
   is none. The outcome is in judged and verdict; the state of a tare by edges stays, its window does not. */
void tare_whole(Tare *tare, size_t count, const double *strain, const double *dynamic_pressure);

/* Set tare->reading; what is not finite, or so large that its square might not be, is none. */
void tare_set_reading(Tare *tare, const double *strain);

/* Forget the zeros: others are given. */
void tare_drop(Tare *tare);

/* The state in bytes; whether bytes may be read. */
size_t tare_state_size(const Tare *tare);
void tare_write_state(const Tare *tare, unsigned char *bytes);
int tare_state_fits(const Tare *tare, const unsigned char *bytes);
void tare_read_state(Tare *tare, const unsigned char *bytes);

/* The records of a tare: what it is given, and what it found.

   Limits: dynamic_pressure [Pa], zero, drift; then (n_gauges) known_strain and known_strain_std. The outcome:
   (n_gauges) zero, zero_std, one zero_common_std, (n_gauges) whether a gauge reads, scatter; then the flags and the
   verdict, in the order of TareFlags and TareVerdict. */

enum { N_TARE_LIMITS = 3, N_TARE_VERDICT = sizeof(TareVerdict) / sizeof(double) };

/* Names of the fields of one value each. */
extern const char *const TARE_LIMIT_NAMES[N_TARE_LIMITS];
extern const char *const TARE_VERDICT_NAMES[N_TARE_VERDICT];

/* Judge by `limits` from now on, which must live as long as that; by the limits of `of_map` if they are NULL. */
void use_limits(Tare *tare, const TareLimits *of_map, const double *limits);

/* Write the outcome of which the zeros (2 n_gauges + 1) are `zero`. */
void write_tare(const Tare *tare, const double *zero, double *outcome);

#endif
