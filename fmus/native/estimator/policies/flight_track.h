/* One sample after another without the filter: from the last flight state, or from a search of the tables. */

#ifndef FLIGHT_TRACK_H
#define FLIGHT_TRACK_H

#include "flight_state.h"

/* Set all outputs by the tables, for so many gauges in use, which is not 0. */
void flight_track_update(Flight *flight, size_t used);

#endif
