#include "fall_back.h"

#include <math.h>

#include "../linear/linear.h"

/* Loads of the linear map in place of those of the tables, where it has some. */
static void fall_back(Flight *flight) {
    const double pressure = flight->navigation.of_loads[0], deviation = flight->navigation.of_loads[1];
    if (isfinite(pressure) && linear_loads_at(flight->linear, pressure, deviation)) {
        flight->flag[LINEAR_LOADS] = 1;
    }
}

void flight_fall_back(Flight *flight, int fits, double to_return) {
    if (!fits || to_return > 0.0) {
        fall_back(flight);
    }
    if (fits && flight->flag[LINEAR_LOADS] && flight->output[HEALTH_STATE] == (double)OK) {
        flight->output[HEALTH_STATE] = DEGRADED;
    }
}

double flight_since_search(const Flight *flight, int searched) {
    const double since = flight->base.since_search + 1.0, most = flight->map.search_every;
    return searched ? 0.0 : since < most ? since : most;
}
