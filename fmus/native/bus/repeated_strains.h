/* Strains of an earlier cycle, read from compiled code. */

#ifndef REPEATED_STRAINS_H
#define REPEATED_STRAINS_H

#include "strainbus.h"

/* Remember a cycle; whether the readings of a frame, or of all, are an earlier one's, which noise does not allow.
   The cycle just before does not count: the watch for frozen gauges judges them. Gauges that are not `plausible` may
   well repeat. */
int repeats_take(SbRepeats *repeats, const SbChecks *checks, const SbCycle *cycle, const uint8_t *plausible);

#endif
