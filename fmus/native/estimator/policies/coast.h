/* Steps without any strain: the last filtered estimate, less and less certain. */

#ifndef COAST_H
#define COAST_H

#include "../filter/filter.h"
#include "flight_state.h"

/* Set all outputs by the last filtered sample, a time ago [s]: rates of the flight state are those that the map allows and
   those last seen. Where it is no longer identified, nothing is known. */
void flight_coast(Flight *flight, Filter *filter, double time);

#endif
