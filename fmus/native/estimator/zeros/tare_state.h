/* What a tare holds: its limits, its window, the zeros that it has found. The limits are part "tare" of resources/map.bin. */

#ifndef TARE_STATE_H
#define TARE_STATE_H

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

#endif
