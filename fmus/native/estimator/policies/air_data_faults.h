/* Air data that fit neither strain nor each other: which are dropped, which are doubted. */

#ifndef AIR_DATA_FAULTS_H
#define AIR_DATA_FAULTS_H

#include "flight_state.h"

/* Whether a quantity of navigation fits strain and the others so badly that it is dropped: the worst one. Below the
   alarm it may as well be another one that is wrong: then they count with larger standard deviations. */
int flight_drop_inconsistent(Flight *flight);

/* Number of quantities of navigation in use; whether one has a value that is not used, and that is no correct one. */
size_t flight_navigation_used(const Flight *flight);
int flight_navigation_alarms(const Flight *flight);

#endif
