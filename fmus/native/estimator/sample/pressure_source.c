#include "pressure_source.h"

/* Those of pressure_source.py. */
#define LARGEST_DIFFERENCE 1.5e-3 /* of a computed value, by the rounding of what is given */
#define PART_OF_DEVIATION 0.05 /* of the standard deviation of the difference of independent values */
#define EARTH_RADIUS 6356766.0   /* [m] of geopotential altitudes */

double pressure_by_altitude(const Inputs *inputs) {
    const double altitude = known_input(inputs, ALTITUDE), found = ambient_pressure(&inputs->map->envelope, altitude);
    return isnan(found) && !isnan(altitude) ? 0.0 : found;
}

double computed_pressure_error(double mach, double mach_std, double pressure_std) {
    const double of_mach = 2.0 * mach_std / mach;
    return sqrt(of_mach * of_mach + pressure_std * pressure_std);
}

double computed_pressure_std(const Inputs *inputs, double stated, double own) {
    const int is_decided = last_input(inputs, Q_SOURCE) > 0.5;
    return isnan(stated) || (!is_decided && stated < own) ? own : stated;
}

/* Whether the dynamic pressure is computed from Mach number and a pressure, of relative standard deviations. */
static int is_computed(const Inputs *inputs, double pressure, double mach_std, double pressure_std, double dynamic_std) {
    const double mach = known_input(inputs, MACH_NUMBER), dynamic = known_input(inputs, DYNAMIC_PRESSURE);
    const double expected = inputs->map->envelope.half_gamma * mach * mach * pressure;
    const double of_computed = computed_pressure_error(mach, mach_std, pressure_std);
    const double part = PART_OF_DEVIATION * sqrt(of_computed * of_computed + dynamic_std * dynamic_std);
    const double allowed = part < LARGEST_DIFFERENCE ? part : LARGEST_DIFFERENCE;
    return expected < INFINITY && fabs(dynamic - expected) <= allowed * expected; /* false where one is not known */
}

PressureSource pressure_source(const Inputs *inputs, double mach_std, double pressure_std, double altitude_std,
                               double dynamic_std) {
    const double stated = last_input(inputs, Q_SOURCE), altitude = known_input(inputs, ALTITUDE);
    if (stated > 0.5 && stated < (double)MACH_AND_ALTITUDE + 0.5) {
        return (PressureSource)(stated + 0.5);
    }
    if (is_computed(inputs, known_input(inputs, STATIC_PRESSURE), mach_std, pressure_std, dynamic_std)) {
        return MACH_AND_PRESSURE;
    }
    const double geopotential = EARTH_RADIUS * altitude / (EARTH_RADIUS + altitude); /* of a geometric altitude */
    const double by_geometric = ambient_pressure(&inputs->map->envelope, geopotential);
    const int by_altitude = is_computed(inputs, pressure_by_altitude(inputs), mach_std, altitude_std, dynamic_std)
                         || is_computed(inputs, by_geometric, mach_std, altitude_std, dynamic_std);
    return by_altitude ? MACH_AND_ALTITUDE : INDEPENDENT;
}
