/* The readings of a sample: which of them are used, and the strains that they stand for. */

#ifndef READINGS_H
#define READINGS_H

#include "inputs.h"

/* Whether a gauge may be used: the caller trusts it, and its reading was set and is a number within its range, which is
   `range` [m/m] for strain. */
unsigned char gauge_in_use(const Inputs *inputs, size_t gauge, double range);

/* Whether strain is no reading: every gauge that may be used reads exactly 0 in a flow, as no gauge under load does. Then
   none is used. With the linear estimator a flow is a dynamic pressure of one, with tables any sample. */
int readings_silent(const Inputs *inputs);

/* Whether the gauges that may be used are the gauges of a mask (n_gauges). */
int readings_are_of(const Inputs *inputs, const unsigned char *mask);

/* Readings `first` up to, not including, `end` were set. */
void readings_note_given(Inputs *inputs, size_t first, size_t end);

/* Take the zeros in use off the strains of the inputs, and scale other sensors. */
void readings_set_strain(Inputs *inputs);

/* What an inertial unit measures becomes channels: specific force, angular acceleration, and the products of angular
   rates that turn with the body. Each is an amplitude of a mode of strain; strainfmu/estimator/map/sensors.py has the
   formulas. */

/* Specific force along x, y, z [m/s2]; angular acceleration about y, z [rad/s2]; xx, yy, zz, xy, xz, yz of
   w w' - |w|^2 1 [rad2/s2]. */
enum { N_INERTIAL_CHANNELS = 11 };

/* Set the channels of the present inputs, NaN of those that are not known. */
void inertial_channels(const Inputs *inputs, double channel[N_INERTIAL_CHANNELS]);

/* The standard deviation of vibrating strain [1]; NaN where it is not known. */
double known_vibration(const Inputs *inputs);

#endif
