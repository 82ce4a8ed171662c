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
