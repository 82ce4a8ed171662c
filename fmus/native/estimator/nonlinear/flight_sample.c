/* What is known of a sample besides its strain: navigation, with standard deviations, and the ranges of the map.

   Seven measurements go to the solver: M, ln p_inf, ln q_inf of navigation, then M, u, w, ln p_inf of the ranges as
   a weak prior, each with the precision 1 / sigma^2, 0 where it is not given. A standard deviation that is not given
   is the map's; none is below 1e-3 of its value, since a smaller one would be rounding of the solution. Special
   rules:

       p_inf by altitude       from the standard atmosphere, with its own relative error
       q_inf computed          from M and a pressure is no measurement: it stands for the one of both that is not given,
                               else it is left out; its sources have the errors of the day, which nothing confirms
       M by total temperature  T_0 = T (1 + (gamma - 1)/2 M^2) with T of the standard atmosphere; joined with a given M by
                               precisions, wider by their distance where that exceeds one standard deviation
       measured angles         u and w join the prior: precisions add, values are their weighted mean

   docs/explanation/nonlinear_estimator.md, "Estimate" and "What comes out"; docs/howto/settings_and_health.md,
   "State where q_inf comes from"; strainfmu/estimator/reference/air.py. */

#include "nonlinear.h"

#include <math.h>

#include "../../core/elementary.h"

/* Smallest standard deviation of a value of navigation, relative. */
#define MIN_RELATIVE_STD 1e-3

/* Relative standard deviations of a total temperature without its own, and of the standard atmosphere's temperature,
   as in air_inputs.py. */
#define TOTAL_TEMPERATURE_ERROR 0.01
#define STATIC_TEMPERATURE_ERROR 0.03

size_t flight_set_strain(FlightSolver *solver, const Inputs *inputs) {
    const double range = scalar_input(inputs, SENSOR_RANGE);
    const int silent = readings_silent(inputs);
    Sample *sample = &solver->sample;
    size_t count = 0;
    for (size_t g = 0; g < solver->n_gauges; g++) {
        sample->used[g] = !silent && gauge_in_use(inputs, g, range);
        sample->strain[g] = sample->used[g] ? inputs->strain[g] : 0.0;
        count += sample->used[g];
    }
    /* Searches of the last strain do not count. */
    solver->n_kept = 0;
    return count;
}

/* The standard deviation of a quantity of navigation without its own: of M [1], relative ones of p_inf, which the altitude
   gives less exactly, and q_inf. */
static double navigation_error(const FlightMap *map, const Inputs *inputs, size_t quantity) {
    const int by_altitude = quantity == 1 && isnan(known_input(inputs, STATIC_PRESSURE));
    return by_altitude ? map->altitude_error : map->navigation_error[quantity];
}

/* M by the total temperature and its standard deviation: M = sqrt(2 (T_0/T - 1) / (gamma - 1)), dM = (T_0/T) e /
   ((gamma - 1) M) by the relative error e of T_0/T. NaN where an input is not known or T_0 is not above T. */
static double mach_by_temperature(const Inputs *inputs, double *std) {
    const Envelope *envelope = &inputs->map->envelope;
    const double total = known_of(inputs, LATER_RUN, TOTAL_TEMPERATURE), stated = known_of(inputs, LATER_RUN, TOTAL_TEMPERATURE_STD);
    const double half = envelope->half_gamma - 0.5; /* T0 = T (1 + half M^2) */
    double pressure, temperature;
    if (isnan(total) || !atmosphere_at(&envelope->atmosphere, known_input(inputs, ALTITUDE), &pressure, &temperature)) {
        return NAN;
    }
    const double ratio = total / temperature, mach = sqrt((ratio - 1.0) / half);
    const double error = isnan(stated) ? TOTAL_TEMPERATURE_ERROR : stated / total;
    const double relative = sqrt(error * error + STATIC_TEMPERATURE_ERROR * STATIC_TEMPERATURE_ERROR);
    *std = 0.5 * ratio * relative / (half * mach);
    return ratio > 1.0 && isfinite(mach) && isfinite(*std) ? mach : NAN;
}

/* Join two values of M by their standard deviations, which grow where the values differ by more. */
static void join(double *value, double *std, double other, double other_std) {
    const int known = isfinite(*value) && *value > 0.0 && isfinite(*std) && *std > 0.0;
    if (isnan(other)) {
        return;
    }
    if (!known) {
        *value = other;
        *std = other_std;
        return;
    }
    const double variance = *std * *std + other_std * other_std, apart = fabs(other - *value) / sqrt(variance);
    *value += *std * *std / variance * (other - *value);
    *std *= other_std / sqrt(variance) * (apart > 1.0 ? apart : 1.0);
}

/* Whether a value of navigation is known. */
static int is_value(double value) {
    return isfinite(value) && value > 0.0;
}

/* A q_inf that is computed from the others. With M and p_inf both given nothing is left of it; with one of them it
   gives the other; with neither it stays q_inf, with the standard deviation of a computed one. */
static void take_out_computed(const FlightMap *map, const Inputs *inputs, Navigation *navigation) {
    double *value = navigation->value, *std = navigation->std;
    const PressureSource source = pressure_source(inputs);
    if (source == INDEPENDENT || !is_value(value[2])) {
        return;
    }
    const int by_altitude = isnan(known_input(inputs, STATIC_PRESSURE));
    const double stated = known_input(inputs, STATIC_PRESSURE_STD);
    const double error = source == MACH_AND_ALTITUDE ? larger(map->altitude_error, DAY_OF_ALTITUDE)
                       : isnan(stated) || by_altitude ? larger(map->navigation_error[1], DAY_OF_PRESSURE) : stated / value[1];
    const double stated_mach = known_input(inputs, MACH_NUMBER_STD);
    if (!is_value(value[0])) {
        std[0] = isnan(stated_mach) ? map->navigation_error[0] : stated_mach;
    } else if (isnan(stated_mach)) {
        const double of_day = DAY_OF_MACH * value[0];
        std[0] = sqrt(std[0] * std[0] + of_day * of_day);
    }
    if (isnan(stated) && is_value(value[1])) {
        std[1] = value[1] * larger(std[1] / value[1], by_altitude ? DAY_OF_ALTITUDE : DAY_OF_PRESSURE);
    }
    const double mach = is_value(value[0]) ? value[0] : map->prior_mean[STATE_MACH];
    const double own = value[2] * computed_pressure_error(mach, std[0], error);
    navigation->is_computed = 1;
    navigation->of_loads[1] = computed_pressure_std(inputs, known_input(inputs, DYNAMIC_PRESSURE_STD), own);
    if (!is_value(value[0]) && !is_value(value[1])) {
        std[2] = navigation->of_loads[1];
        return;
    }
    if (!is_value(value[1])) {
        value[1] = value[2] / (map->half_gamma * value[0] * value[0]);
        std[1] = value[1] * error;
    } else if (!is_value(value[0])) {
        value[0] = sqrt(value[2] / (map->half_gamma * value[1]));
    }
    value[2] = std[2] = NAN;
}

void navigation_of(const FlightMap *map, const Inputs *inputs, Navigation *navigation) {
    double *value = navigation->value, *std = navigation->std;
    value[0] = known_input(inputs, MACH_NUMBER);
    value[1] = known_input(inputs, STATIC_PRESSURE);
    value[1] = isnan(value[1]) ? pressure_by_altitude(inputs) : value[1];
    value[2] = known_input(inputs, DYNAMIC_PRESSURE);
    std[0] = known_input(inputs, MACH_NUMBER_STD);
    std[1] = known_input(inputs, STATIC_PRESSURE_STD);
    std[2] = known_input(inputs, DYNAMIC_PRESSURE_STD);
    for (size_t k = 0; k < N_NAVIGATION; k++) {
        const double own = navigation_error(map, inputs, k) * (k == 0 ? 1.0 : value[k]);
        const double least = MIN_RELATIVE_STD * fabs(value[k]);
        std[k] = isnan(std[k]) ? own : std[k];
        std[k] = std[k] > least ? std[k] : least;
    }
    navigation->is_computed = 0;
    navigation->of_loads[0] = value[2];
    navigation->of_loads[1] = std[2];
    take_out_computed(map, inputs, navigation);
    double by_temperature_std = 0.0;
    const double by_temperature = mach_by_temperature(inputs, &by_temperature_std);
    join(&value[0], &std[0], by_temperature, by_temperature_std);
}

/* The product of two normal densities: precisions add, the mean is weighted by them. */
static void join_angles(const MeasuredAngles *angles, Sample *sample) {
    for (size_t k = 0; k < 2 && angles->count > 0; k++) {
        const size_t which = N_NAVIGATION + STATE_U + k;
        const double sum = sample->precision[which] + angles->precision[k];
        sample->value[which] =
            (sample->precision[which] * sample->value[which] + angles->precision[k] * angles->value[k]) / sum;
        sample->precision[which] = sum;
    }
}

/* Navigation as M, ln p_inf, ln q_inf with precisions of these, then the prior. */
void flight_set_measurement(FlightSolver *solver, const double *navigation, const double *navigation_std) {
    Sample *sample = &solver->sample;
    for (size_t k = 0; k < N_NAVIGATION; k++) {
        const double value = navigation[k], std = navigation_std[k];
        const double scale = k == 0 ? std : std / value, precision = 1.0 / (scale * scale);
        const int known = isfinite(value) && value > 0.0 && isfinite(std) && std > 0.0 && precision > 0.0 && isfinite(precision);
        sample->value[k] = !known ? 0.0 : k == 0 ? value : logarithm(value);
        sample->precision[k] = known ? precision : 0.0;
    }
    memcpy(sample->value + N_NAVIGATION, solver->map->prior_mean, sizeof solver->map->prior_mean);
    memcpy(sample->precision + N_NAVIGATION, solver->map->prior_precision, sizeof solver->map->prior_precision);
    join_angles(&solver->angles, sample);
}
