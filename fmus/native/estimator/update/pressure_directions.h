/* The directions of a map in form "dynamic_pressure" that serve every dynamic pressure, for the errors of its gauges.

   docs/explanation/dynamic_pressure.md has the formulas. */

#ifndef PRESSURE_DIRECTIONS_H
#define PRESSURE_DIRECTIONS_H

#include "noise_state.h"

/* Number of doubles of noise->large that it needs. */
size_t pressure_directions_doubles(const Map *map);

/* Set the arrays of ScaledForm that follow from others. 0 if the covariance of the gauges is none. */
int set_pressure_directions(AddedNoise *noise);

#endif
