/* The filter over time, part "filter" of resources/map.bin. */

#ifndef FILTER_MAP_H
#define FILTER_MAP_H

#include "flight_map.h"

typedef struct {
    double smallest_time, largest_time; /* of the time constant; the latter of a step, too [s] */
    double white_navigation;            /* part of the variance of air data that is independent from sample to sample */
    double rate[N_STATES];              /* standard deviations of the rates of the flight state [1/s] */
    const double *noise;                /* (n_gauges) variances of what is independent from sample to sample [1] */
} FilterMap;

/* Read the part. 1; 0 with a text that states what is wrong. */
int filter_map_parse(MapFile *file, size_t n_gauges, FilterMap *map);

#endif
