/* What a solution says: loads, coefficients, air data, and the conditions that health follows from. */

#ifndef FLIGHT_OUTPUTS_H
#define FLIGHT_OUTPUTS_H

#include "flight_state.h"

/* Whether strain, of so many gauges in use, and navigation fit the tables. */
int flight_solution_fits(const Flight *flight, size_t used);

/* Write the solution to the outputs; whether it fits. */
int flight_conclude(Flight *flight, size_t used);

/* Nothing is known, for this condition, and the step leaves the track as it was. */
void flight_set_nothing_known(Flight *flight, int condition);

#endif
