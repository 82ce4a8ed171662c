/* The filter over time of a linear map, part "linear_filter" of resources/map.bin. */

#ifndef LINEAR_FILTER_MAP_H
#define LINEAR_FILTER_MAP_H

#include "map_resource.h"

/* Arrays point into the bytes of the file. Quantities: strainfmu/estimator/reference/linear_filter.py. */
typedef struct {
    size_t n_scaled; /* states that scale with q_inf */
    size_t n_common; /* those that do not: errors that gauges have in common, then amplitudes of temperature modes */
    size_t n_modes;  /* number of the latter */
    size_t n_own;    /* errors that are considered and do not follow q_inf */
    size_t n_rest;   /* those that do */
    double slow;     /* time constant of the common errors but modes over that of the others */
    double smallest_time, largest_time; /* of the time constant; the latter of a step, too [s] */
    const double *std;        /* (n_scaled + n_common) of the stationary law */
    const double *scaled;     /* (n_scaled, n_gauges) strain at the nominal q_inf, */
    const double *load;       /* (n_scaled, 5) and loads */
    const double *common;     /* (n_common, n_gauges) */
    const double *own;        /* (n_own, n_gauges) */
    const double *rest;       /* (n_rest, n_gauges) at the nominal q_inf */
    const double *noise;      /* (n_gauges) variances */
    const double *rest_cross; /* (5, n_gauges) covariance of loads with strain of the directions not estimated */
} LinearFilterMap;

/* Read the part. 1; 0 with a text that states what is wrong. */
int linear_filter_map_parse(MapFile *file, size_t n_gauges, LinearFilterMap *map);

#endif
