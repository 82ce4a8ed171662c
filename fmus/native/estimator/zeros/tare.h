/* A tare by the edges of the input `tare`: while it is true readings are averaged, then judged, and become the zeros.

   The C counterpart of strainfmu/estimator/zeros/tare_edge.py, and of tare.py, which has the formulas; it
   is part "tare" of resources/map.bin. */

#ifndef TARE_H
#define TARE_H

#include "../map/container.h"
#include "tare_window.h"

enum { TARE_IDLE, TARE_AVERAGING, TARE_DONE, TARE_REFUSED };

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
    double *reading, *scratch;
    int to_report; /* whether there is an outcome in text that was not reported */
    char text[MODEL_TEXT_SIZE];
} Tare;

/* Read the part, if there is one, and allocate. 1; 0 after a message. */
int tare_create(MapFile *file, size_t n_gauges, double largest_zero, Tare *tare);
void tare_free(Tare *tare);
void tare_reset(Tare *tare);

/* Take in the input at a step or an event; whether there are other zeros now. mean_strain (n_gauges) is the map's. */
int tare_follow(Tare *tare, const double *mean_strain);

/* Take in tare->reading (n_gauges), NaN for gauges not in use, and the dynamic pressure [Pa], NaN if it is not known. */
void tare_take(Tare *tare, double dynamic_pressure);

/* Whether tare_take is to be called. */
static inline int tare_is_averaging(const Tare *tare) {
    return tare->flags.state == (double)TARE_AVERAGING;
}

/* Forget the zeros: others are given. */
void tare_drop(Tare *tare);

/* The state in bytes; whether bytes may be read. */
size_t tare_state_size(const Tare *tare);
void tare_write_state(const Tare *tare, unsigned char *bytes);
int tare_state_fits(const Tare *tare, const unsigned char *bytes);
void tare_read_state(Tare *tare, const unsigned char *bytes);

#endif
