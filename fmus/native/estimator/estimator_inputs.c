/* Inputs and settings of the estimator: the place of each, its start value, and the values it accepts. */

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "estimator.h"

static const char *const SETTING_NAMES[] = {
    "dynamic_pressure", "dynamic_pressure_std", "mach_number",      "altitude",       "sensor_range",
    "alarm_scale",      "reference_area",       "reference_length", "moment_station",
};

size_t first_temperature(const Estimator *e) {
    return e->map.n_gauges + N_ALL_SCALARS + number_of_zeros(e->sensors.n_strains);
}

/* The first input behind the temperatures. */
static size_t behind_temperatures(const Estimator *e) {
    return first_temperature(e) + (e->thermal.present ? e->thermal.map.n_sensors : 0);
}

size_t thrust_input(const Estimator *e) {
    return e->sensors.has_thrust ? behind_temperatures(e) : SIZE_MAX;
}

size_t first_parameter(const Estimator *e) {
    return behind_temperatures(e) + (e->sensors.has_thrust ? 1 : 0) + (e->map.has_filter ? 1 : 0);
}

size_t first_parameter_std(const Estimator *e) {
    return first_parameter(e) + e->parameters.count;
}

size_t filter_setting(const Estimator *e) {
    return e->map.has_filter ? first_parameter(e) - 1 : SIZE_MAX;
}

size_t estimator_inputs(const Estimator *e) {
    return first_parameter_std(e) + (e->map.has_known ? e->parameters.count : 0);
}

size_t estimator_outside(const Estimator *e) {
    return parameter_outside(&e->parameters, e->input + first_parameter(e), e->map.not_known);
}

void inputs_reset(Estimator *e) {
    const size_t n = e->map.n_gauges;
    double *scalar = e->input + n;
    memset(e->input, 0, n * sizeof *e->input);
    memset(e->valid, 1, n);
    memset(e->given, 0, n);
    e->n_given = 0;
    memset(scalar, 0, (estimator_inputs(e) - n) * sizeof *scalar);
    scalar[DYNAMIC_PRESSURE] = e->flight.present ? 0.0 : e->map.dynamic_pressure;
    scalar[SENSOR_RANGE] = e->map.sensor_range;
    scalar[ALARM_SCALE] = 1.0;
    scalar[REFERENCE_AREA] = e->map.reference_area;
    scalar[REFERENCE_LENGTH] = e->map.reference_length;
    scalar[MOMENT_STATION] = e->map.moment_station;
    for (size_t k = 0; k < e->parameters.count; k++) {
        e->input[first_parameter(e) + k] = e->map.not_known;
    }
}

/* Whether value may be given to one of the zeros or their deviations, by its index among them. */
static int accepts_zero(const Estimator *e, size_t which, double value, char *text) {
    const size_t n = e->sensors.n_strains;
    const double largest = e->map.largest_zero, smallest = which < n ? -largest : 0.0;
    char name[32] = "zero_common_std";
    if (value >= smallest && value <= largest) {
        return 1;
    }
    if (which < 2 * n) {
        snprintf(name, sizeof name, "%s[%lu]", which < n ? "zero" : "zero_std", (unsigned long)(which % n + 1));
    }
    snprintf(text, MODEL_TEXT_SIZE, "%s: expected %g to %g m/m, got %g", name, smallest, largest, value);
    return 0;
}

static int accepts_time_constant(const Estimator *e, double value, char *text) {
    const int linear = e->linear_filter.present;
    const double smallest = linear ? e->linear_filter.map.smallest_time : e->flight.filter.map.smallest_time;
    const double largest = linear ? e->linear_filter.map.largest_time : e->flight.filter.map.largest_time;
    if (value == 0.0 || (value >= smallest && value <= largest)) {
        return 1;
    }
    snprintf(text, MODEL_TEXT_SIZE, "filter_time_constant: %g found, must be 0 or between %g and %g", value, smallest,
             largest);
    return 0;
}

int estimator_accepts(const Estimator *e, size_t index, double value, char text[MODEL_TEXT_SIZE]) {
    if (index == filter_setting(e)) {
        return accepts_time_constant(e, value, text);
    }
    if (index >= first_temperature(e)) {
        return 1;
    }
    if (index >= e->map.n_gauges + N_ALL_SCALARS) {
        return accepts_zero(e, index - (e->map.n_gauges + N_ALL_SCALARS), value, text);
    }
    if (index < e->map.n_gauges + SENSOR_RANGE || index >= e->map.n_gauges + N_SCALAR_INPUTS) {
        return 1;
    }
    const size_t setting = index - e->map.n_gauges;
    const double largest = e->map.largest_setting, smallest = setting == MOMENT_STATION ? -largest : e->map.smallest_setting;
    if (value >= smallest && value <= largest) {
        return 1;
    }
    snprintf(text, MODEL_TEXT_SIZE, "%s: %g found, must be between %g and %g", SETTING_NAMES[setting], value, smallest,
             largest);
    return 0;
}
