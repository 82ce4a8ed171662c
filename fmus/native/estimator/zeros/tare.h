/* A tare by the edges of the input `tare`: while it is true readings are averaged, then judged, and become the zeros;
   or of a whole window of readings at once. tare_judge.h has the formulas.

   Limits and the strain of known loads are part "tare" of resources/map.bin. */

#ifndef TARE_H
#define TARE_H

#include "../map/container.h"
#include "tare_window.h"

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
    double dynamic_pressure, zero, drift; /* largest [Pa], [1], and rise over the window [1] */
    double least_samples, least_part, least_gauges, own_factor, moved, loud, like_load;
    const double *noise_std;         /* (n_gauges) [1] */
    const double *known, *known_std; /* (n_gauges) strain of the loads that act meanwhile, and its deviation [1] */
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
    double memory;                            /* factor on deviations by which readings depend on each other */
    double gauges, rms, largest_std;          /* gauges that have a zero; rms of the zeros, their largest deviation */
    double dynamic_pressure, samples_without; /* the largest one [Pa] or that of the step; samples without one */
    double drifting_gauge, drift;             /* the largest rise over the window that is one */
    double moving_gauge, scatter;             /* the largest by the noise of the gauge */
    double largest_gauge, largest;            /* the largest reading less known strain */
    double along, along_limit;                /* part along the strain of the mean flight, and of random zeros */
} TareVerdict;

typedef struct {
    int present; /* whether the map has the part; if not, nothing else is set */
    size_t n_gauges;
    double largest_zero; /* [1] */
    TareLimits limits;
    void *memory;
    int up;      /* the input */
    TareFlags flags;
    double *zero; /* (2 n_gauges + 1) of a tare: zeros, deviations, that in common [1]; the window follows */
    TareWindow window;
    WindowStatistics found;
    double *judged; /* (2 n_gauges + 1) zeros of the last window, also of one that is refused */
    TareVerdict verdict;
    double *reading, *scratch;
    int to_report; /* whether there is an outcome in text that was not reported */
    char text[MODEL_TEXT_SIZE];
} Tare;

/* Read the part, if there is one, and allocate. 1; 0 after a message. */
int tare_create(MapFile *file, size_t n_gauges, double largest_zero, Tare *tare);
void tare_free(Tare *tare);

/* Another tare of the same map, which has not begun; that must live as long. 1; 0 without memory. */
int tare_like(const Tare *other, Tare *tare);
void tare_reset(Tare *tare);

/* Take in the input at a step or an event; whether there are other zeros now. mean_strain (n_gauges) is the map's. */
int tare_follow(Tare *tare, const double *mean_strain);

/* Take in tare->reading (n_gauges), NaN for gauges not in use, and the dynamic pressure [Pa], NaN if it is not known. */
void tare_take(Tare *tare, double dynamic_pressure);

/* Whether tare_take is to be called. */
static inline int tare_is_averaging(const Tare *tare) {
    return tare->flags.state == TARE_AVERAGING;
}

/* Judge a window of `count` samples at once: strain (count, n_gauges), dynamic_pressure (count) [Pa], NaN where there
   is none. The outcome is in judged and verdict; the state of a tare by edges stays, its window does not. */
void tare_whole(Tare *tare, const double *mean_strain, size_t count, const double *strain,
                const double *dynamic_pressure);

/* Set tare->reading; what is not finite, or so large that its square might not be, is none. */
void tare_set_reading(Tare *tare, const double *strain);

/* Forget the zeros: others are given. */
void tare_drop(Tare *tare);

/* The state in bytes; whether bytes may be read. */
size_t tare_state_size(const Tare *tare);
void tare_write_state(const Tare *tare, unsigned char *bytes);
int tare_state_fits(const Tare *tare, const unsigned char *bytes);
void tare_read_state(Tare *tare, const unsigned char *bytes);

#endif
