/* Channels of an inertial unit: amplitudes of the modes of strain that the inertia of the structure makes.

   The acceleration of a point x of a rigid body, less gravity, is f + alpha x x + (w w' - |w|^2 1) x, with the
   specific force f, the angular acceleration alpha and the angular rate w. Strain is linear in these, so that each
   is a channel: f_x, f_y, f_z, alpha_y, alpha_z (alpha_x makes no bending), and the six elements of the symmetric
   matrix w w' - |w|^2 1,

       xx = -(w_y^2 + w_z^2),   yy = -(w_x^2 + w_z^2),   zz = -(w_x^2 + w_y^2),   xy = w_x w_y,   xz = w_x w_z,   yz = w_y w_z.

   A channel is NaN where one of its inputs is not known: its mode then has its prior variance
   (temperature/thermal.c). strainfmu/estimator/map/sensors.py derives the modes. */

#include "inertia.h"

static double known_inertial(const Inputs *inputs, size_t which) {
    const double value = inputs->value[first_inertial(inputs) + which];
    return value != inputs->map->not_known && isfinite(value) ? value : NAN;
}

double known_vibration(const Inputs *inputs) {
    const double value = known_inertial(inputs, VIBRATION);
    return value >= 0.0 ? value : NAN;
}

void inertial_channels(const Inputs *inputs, double channel[N_INERTIAL_CHANNELS]) {
    double known[N_INERTIAL_INPUTS];
    for (size_t k = 0; k < N_INERTIAL_INPUTS; k++) {
        known[k] = known_inertial(inputs, k);
    }
    const double x = known[ANGULAR_RATE_X], y = known[ANGULAR_RATE_Y], z = known[ANGULAR_RATE_Z];
    channel[0] = known[SPECIFIC_FORCE_X];
    channel[1] = known[SPECIFIC_FORCE_Y];
    channel[2] = known[SPECIFIC_FORCE_Z];
    channel[3] = known[ANGULAR_ACCELERATION_Y];
    channel[4] = known[ANGULAR_ACCELERATION_Z];
    channel[5] = -(y * y + z * z);
    channel[6] = -(x * x + z * z);
    channel[7] = -(x * x + y * y);
    channel[8] = x * y;
    channel[9] = x * z;
    channel[10] = y * z;
}
