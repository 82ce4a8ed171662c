/* Air data of a sample: what a dynamic pressure is computed from, and its standard deviation then.

   q = gamma/2 M^2 p: where it is computed from M and a pressure it adds no information, and its relative error is,
   to first order,

       (s_q / q)^2 = (2 s_M / M)^2 + (s_p / p)^2.

   The input q_source states the source; without it a q_inf that comes with M counts as computed, from p_inf where
   that is given, else from the standard atmosphere at the altitude. A stated standard deviation smaller than by
   these sources then counts only where the source is stated too. docs/howto/settings_and_health.md, "State where
   q_inf comes from"; strainfmu/estimator/reference/air.py. */

#include "air_data.h"

#include "../../core/elementary.h"

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

/* Measured angle of attack alpha and sideslip beta as the components (u, w) of the flow direction that the flight
   state has.

   The flow comes along (cos beta cos alpha, -sin beta, cos beta sin alpha): aft, to starboard, up. With the total
   angle a to the axis, sin a = sqrt(up^2 + starboard^2), the state has u = a up / sin a and w = a starboard / sin a;
   a / sin a tends to 1 on the axis. Precisions are 1 / std^2 of the angles, which to first order are u and -w.
   docs/howto/settings_and_health.md, "State where the vehicle flies"; measured_directions in
   strainfmu/estimator/reference/air.py. */

/* Of measured angles [rad]: standard deviation without their own, the smallest one, and the size above which one is no value;
   as in that file and air_inputs.py. */
#define ANGLE_ERROR 0.017453292519943295
#define LEAST_ANGLE_STD 1e-4
#define LARGEST_ANGLE 1.5

void measured_angles(const Inputs *inputs, MeasuredAngles *angles) {
    const double attack = measured_angle(inputs, MEASURED_ATTACK), sideslip = measured_angle(inputs, MEASURED_SIDESLIP);
    if (isnan(attack) && isnan(sideslip)) {
        *angles = (MeasuredAngles){.count = 0};
        return;
    }
    const double stated[2] = {last_input(inputs, MEASURED_ATTACK_STD), last_input(inputs, MEASURED_SIDESLIP_STD)};
    const int known[2] = {fabs(attack) < LARGEST_ANGLE, fabs(sideslip) < LARGEST_ANGLE};
    angles->count = (size_t)known[0] + (size_t)known[1];
    angles->value[0] = angles->value[1] = 0.0;
    if (angles->count > 0) {
        double sine[2], cosine[2];
        sine_cosine(known[0] ? attack : 0.0, &sine[0], &cosine[0]);
        sine_cosine(known[1] ? sideslip : 0.0, &sine[1], &cosine[1]);
        const double along = cosine[1] * cosine[0], up = cosine[1] * sine[0], starboard = -sine[1];
        const double across = sqrt(up * up + starboard * starboard);
        /* a / sin a. */
        const double ratio = across > 0.0 ? angle_of(across, along) / across : 1.0;
        angles->value[0] = ratio * up;
        angles->value[1] = ratio * starboard;
    }
    for (size_t k = 0; k < 2; k++) {
        const double std = isnan(stated[k]) ? ANGLE_ERROR : stated[k] > LEAST_ANGLE_STD ? stated[k] : LEAST_ANGLE_STD;
        angles->precision[k] = known[k] ? 1.0 / (std * std) : 0.0;
    }
}
