/* What a dynamic pressure is computed from, and its standard deviation then.

   q = gamma/2 M^2 p: where it is computed from M and a pressure it adds no information, and its relative error is,
   to first order,

       (s_q / q)^2 = (2 s_M / M)^2 + (s_p / p)^2.

   The input q_source states the source; without it a q_inf that comes with M counts as computed, from p_inf where
   that is given, else from the standard atmosphere at the altitude. A stated standard deviation smaller than by
   these sources then counts only where the source is stated too. docs/howto/settings_and_health.md, "State where
   q_inf comes from"; strainfmu/estimator/reference/air.py. */

#include "pressure_source.h"

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

PressureSource pressure_source(const Inputs *inputs) {
    const double stated = last_input(inputs, Q_SOURCE);
    if (stated > 0.5 && stated < (double)MACH_AND_ALTITUDE + 0.5) {
        return (PressureSource)(stated + 0.5);
    }
    if (isnan(known_input(inputs, MACH_NUMBER))) {
        return INDEPENDENT;
    }
    return isnan(known_input(inputs, STATIC_PRESSURE)) ? MACH_AND_ALTITUDE : MACH_AND_PRESSURE;
}
