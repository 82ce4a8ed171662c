/* What an inertial unit measures becomes channels: specific force, angular acceleration, and the products of angular
   rates that turn with the body. Each is an amplitude of a mode of strain; strainfmu/estimator/map/sensors.py has the
   formulas. */

#ifndef INERTIA_H
#define INERTIA_H

#include "inputs.h"

/* Specific force along x, y, z [m/s2]; angular acceleration about y, z [rad/s2]; xx, yy, zz, xy, xz, yz of
   w w' - |w|^2 1 [rad2/s2]. */
enum { N_INERTIAL_CHANNELS = 11 };

/* Set the channels of the present inputs, NaN of those that are not known. */
void inertial_channels(const Inputs *inputs, double channel[N_INERTIAL_CHANNELS]);

/* The standard deviation of vibrating strain [1]; NaN where it is not known. */
double known_vibration(const Inputs *inputs);

#endif
