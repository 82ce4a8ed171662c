/* The filter over time of a nonlinear map, part "filter" of resources/map.bin. */

#ifndef FILTER_MAP_H
#define FILTER_MAP_H

#include "flight_map.h"
#include "map_resource.h"

/* Arrays point into the bytes of the file. Quantities: strainfmu/estimator/reference/flight_filter.py. */
typedef struct {
    size_t n_seen;   /* directions of pressure off the tables that are estimated */
    size_t n_shared; /* errors that gauges have in common and that do not follow strain, those of temperature last */
    size_t n_modes;  /* number of the latter: of amplitudes of temperature modes [K] */
    size_t n_terms;  /* errors of each gauge that last, per p_inf */
    size_t n_other; /* loads beside the five */
    size_t n_own;    /* 1 if gauges have errors that last and do not follow strain, or 0 */
    double rate[N_STATES];      /* standard deviations of the rates [1/s] */
    double rate_time, slow;     /* [s], [1] */
    double white_navigation;    /* part of its variance that is independent from sample to sample */
    double window, band;        /* of the consistency: steps; deviations */
    double widen, narrow, largest_widening;
    double smallest_time, largest_time; /* of the time constant; the latter of a step, too [s] */
    double named_after, fits;   /* named_navigation.py: steps; deviations */
    double slope_time;          /* of the flight state of slopes [s] */
    double of_age, longest_step; /* flight_track.py: that over its age; time step over that */
    const double *seen_strain;  /* (n_seen, n_gauges) per p_inf */
    const double *seen_load;    /* (n_seen, 5) */
    const double *rest_strain;  /* (n_gauges, n_gauges) covariances of the other directions */
    const double *rest_load;    /* (5, 5) */
    const double *rest_cross;   /* (5, n_gauges) */
    const double *noise;        /* (n_gauges, n_gauges) */
    const double *shared;       /* (n_shared, n_gauges) */
    const double *of_gauge;     /* (n_terms, 6, n_gauges) */
    const double *own;          /* (n_own, n_gauges) */
    const double *other_load;     /* (n_other, n_seen) per p_inf */
    const double *other_cross;    /* (n_other, n_gauges) covariances with strain, of the other directions, */
    const double *other_variance; /* (n_other) and of the loads */
} FilterMap;

/* Read the part. 1; 0 with a text that states what is wrong. */
int filter_map_parse(MapFile *file, size_t n_gauges, FilterMap *map);

#endif
