/* Readings of a sample: which of them are used, and the rows of strain that they stand for.

   A reading is used where the caller trusts it, it was set, and it is a number within its range (NaN fails every
   comparison). If all of them that may be used are exactly 0 in a flow, no gauge is connected: none is used. A row
   is the reading less its zero offset; of an auxiliary sensor the reading less what thrust makes of it, over its
   scale. Thermal strain is subtracted afterwards (temperature/thermal.c). docs/developers/native.md, "Gauges, zero
   offsets, temperatures". */

#include "readings.h"

#include <math.h>
#include <string.h>


/* What a other sensor, by its number behind the strain gauges, reads without thrust. */
static double sensor_reading(const Inputs *in, size_t which) {
    const size_t place = single_input(in, THRUST_RUN);
    const double thrust = place == SIZE_MAX ? 0.0 : in->value[place];
    const double reading = in->value[in->sensors->n_strains + which];
    return without_thrust(in->sensors, which, reading, thrust == in->map->not_known ? NAN : thrust);
}

/* Whether what a other sensor reads is a number within its range. */
static int sensor_works(const Inputs *in, size_t which) {
    return fabs(sensor_reading(in, which)) <= in->sensors->largest[which];
}

unsigned char gauge_in_use(const Inputs *in, size_t i, double range) {
    const size_t n = in->sensors->n_strains;
    return (unsigned char)(in->valid[i] & in->given[i] & (i < n ? fabs(in->value[i]) <= range : sensor_works(in, i - n)));
}

int readings_silent(const Inputs *in) {
    const double range = scalar_input(in, SENSOR_RANGE);
    int reads = 0;
    for (size_t i = 0; i < in->sensors->n_strains; i++) {
        const int in_use = gauge_in_use(in, i, range);
        if (in_use && in->value[i] != 0.0) {
            return 0;
        }
        reads |= in_use;
    }
    if (!reads) {
        return 0;
    }
    return in->map->has_tables || scalar_input(in, DYNAMIC_PRESSURE) >= in->map->min_dynamic_pressure;
}

void readings_note_given(Inputs *in, size_t first, size_t end) {
    for (size_t i = first; in->n_given < in->map->n_gauges && i < end; i++) {
        in->n_given += !in->given[i];
        in->given[i] = 1;
    }
}

/* A quick look first, without branches: if nothing is out of range the mask is the caller's, as in nearly every
   step. */
int readings_are_of(const Inputs *in, const unsigned char *mask) {
    const size_t n = in->map->n_gauges;
    const double range = scalar_input(in, SENSOR_RANGE);
    int broken = in->n_given < n;
    for (size_t i = 0; i < in->sensors->n_strains; i++) {
        broken |= !(fabs(in->value[i]) <= range);
    }
    for (size_t k = 0; k < in->sensors->count; k++) {
        broken |= !sensor_works(in, k);
    }
    if (!broken) {
        return memcmp(mask, in->valid, n) == 0;
    }
    int changed = 0;
    for (size_t i = 0; i < n; i++) {
        changed |= mask[i] ^ gauge_in_use(in, i, range);
    }
    return !changed;
}

void readings_set_strain(Inputs *in) {
    const double *restrict zero = in->zeros;
    const size_t n = in->sensors->n_strains;
    for (size_t i = 0; i < n; i++) {
        in->strain[i] = in->value[i] - zero[i];
    }
    for (size_t k = 0; k < in->sensors->count; k++) {
        in->strain[n + k] = sensor_reading(in, k) / in->sensors->scale[k];
    }
}

/* Channels of an inertial unit: amplitudes of the modes of strain that the inertia of the structure makes.

   The acceleration of a point x of a rigid body, less gravity, is f + alpha x x + (w w' - |w|^2 1) x, with the
   specific force f, the angular acceleration alpha and the angular rate w. Strain is linear in these, so that each
   is a channel: f_x, f_y, f_z, alpha_y, alpha_z (alpha_x makes no bending), and the six elements of the symmetric
   matrix w w' - |w|^2 1,

       xx = -(w_y^2 + w_z^2),   yy = -(w_x^2 + w_z^2),   zz = -(w_x^2 + w_y^2),   xy = w_x w_y,   xz = w_x w_z,   yz = w_y w_z.

   A channel is NaN where one of its inputs is not known: its mode then has its prior variance
   (temperature/thermal.c). strainfmu/estimator/map/sensors.py derives the modes. */

static double known_inertial(const Inputs *inputs, size_t which) {
    const double value = inputs->value[inputs->first[INERTIAL_RUN] + which];
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
