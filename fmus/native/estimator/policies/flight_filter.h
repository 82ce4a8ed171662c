/* One sample after another by the filter: strainfmu/estimator/reference/flight_filter.py. */

#ifndef FLIGHT_FILTER_H
#define FLIGHT_FILTER_H

#include "flight_state.h"

/* Whether samples are filtered: the time constant is positive. */
static inline int flight_filters(const Flight *flight) {
    return flight->filter.present && flight->inputs->value[filter_setting(flight->inputs)] > 0.0;
}

/* Set all outputs by the filter, for so many gauges in use. */
void flight_filter_update(Flight *flight, size_t used);

#endif
