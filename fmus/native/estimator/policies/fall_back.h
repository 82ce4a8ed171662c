/* Loads of the linear map where the tables' loads do not fit, the return to these, and when the tables are searched. */

#ifndef FALL_BACK_H
#define FALL_BACK_H

#include "flight_state.h"

/* Loads of the linear map instead of the tables' loads, where it has some, and where these do not fit or have not for
   long enough, or where fewer gauges are left than the flight state has quantities; UNIDENTIFIED where it has none
   then. */
void flight_fall_back(Flight *flight, size_t used, int fits, double to_return);

/* Steps since the last search of the tables, as the step leaves them. */
double flight_since_search(const Flight *flight, int searched);

/* Steps that still must fit after one more that does. */
static inline double flight_waiting(const Flight *flight) {
    return flight->base.to_return > 1.0 ? flight->base.to_return - 1.0 : 0.0;
}

#endif
