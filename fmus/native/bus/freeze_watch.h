/* Whether chance gives so many repetitions. */

#ifndef FREEZE_WATCH_H
#define FREEZE_WATCH_H

#include "strainbus.h"

/* Whether all healthy gauges that are present, or a mask's alone, may repeat their readings `run` times in a row
   by chance: their noise is so small against the quantisation. */
int watch_may_be_chance(const SbWatch *watch, const double *strain, const uint8_t *present, const uint8_t *only,
                        int64_t run);

#endif
