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
    const size_t place = thrust_input(in);
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
