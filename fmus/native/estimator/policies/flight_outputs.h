/* What a solution says: loads, coefficients, air data, health. */

#ifndef FLIGHT_OUTPUTS_H
#define FLIGHT_OUTPUTS_H

#include "flight_state.h"

/* Write the solution to the outputs; whether strain and navigation fit the tables. */
int flight_conclude(Flight *flight, size_t used);

/* Nothing is known, and the step leaves what it found. */
void flight_set_nothing_known(Flight *flight);

#endif
