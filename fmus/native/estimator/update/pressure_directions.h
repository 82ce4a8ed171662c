/* The directions of a map in form "dynamic_pressure" that serve every dynamic pressure, for the errors of its gauges.

   docs/explanation/dynamic_pressure.md has the formulas. */

#ifndef PRESSURE_DIRECTIONS_H
#define PRESSURE_DIRECTIONS_H

#include "noise_state.h"

/* Number of doubles of noise->large that it needs. */
size_t pressure_directions_doubles(const Map *map);

/* Make the arrays of ScaledForm and OtherLoads that follow from others, part by part. The first one returns 0 if the
   covariance of the gauges is none; the others 1 where they have come to their ends, by parts of about `work`
   multiplications. */
int pressure_directions_begin(AddedNoise *noise);
int pressure_directions_turn(AddedNoise *noise, size_t work);
int pressure_directions_take(AddedNoise *noise, size_t work);

#endif
