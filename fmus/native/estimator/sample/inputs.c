/* Inputs and settings of the estimator in one array: the place of each, its start value, and the values that it
   accepts.

       readings (n) | flow, settings, air data | zero offsets | temperatures | thrust | time constant | parameters | their
       standard deviations | later air data | last air data and angles | inertial unit

   Runs that a map does not have are empty, so that places depend on the map. New inputs stand at the end: numbers of
   variables of exported FMUs stay. Strain, pressures and temperatures accept any value, since health reports what
   makes no sense; settings and zero offsets have bounds, since nothing else would notice a wrong one.
   docs/developers/native.md, "Variables" and "Gauges, zero offsets, temperatures". */

#include "inputs.h"

#include <stdio.h>
#include <string.h>

const char *const SCALAR_NAMES[N_SCALAR_INPUTS] = {
    FLOW_INPUTS(AIR_INPUT_NAME) "sensor_range", "alarm_scale", "reference_area", "reference_length", "moment_station",
};

int sensor_rows_parse(MapFile *file, size_t n_gauges, SensorRows *rows) {
    if (map_has(file, "sensors")) {
        MAP_READ(file, "sensors", SENSORS, SensorRows, rows);
    }
    for (size_t k = 0; file->good && k < rows->count; k++) {
        rows->has_thrust |= rows->thrust_response[k] != 0.0;
    }
    rows->n_strains = file->length[SYM_STRAINS] = n_gauges - rows->count;
    return file->good;
}

int flow_parameters_parse(MapFile *file, FlowParameters *parameters) {
    if (!map_has(file, "parameters")) {
        return file->good;
    }
    MAP_READ(file, "parameters", PARAMETERS, FlowParameters, parameters);
    for (size_t i = 0; file->good && i < parameters->count; i++) {
        map_require(file, parameters->maximum[i] >= parameters->minimum[i], "parameters.maximum",
                    "no number below the minimum");
    }
    return file->good;
}

double parameter_score(const FlowParameters *parameters, size_t which, double value) {
    const double low = parameters->minimum[which], high = parameters->maximum[which];
    const double excess = value < low ? low - value : value > high ? value - high : 0.0;
    const double score = excess / parameters->span[which];
    return score < parameters->largest_score ? score : parameters->largest_score;
}

size_t first_temperature(const Inputs *in) {
    return in->map->n_gauges + N_ALL_SCALARS + number_of_zeros(in->sensors->n_strains);
}

/* The first input behind the temperatures. */
static size_t behind_temperatures(const Inputs *in) {
    return first_temperature(in) + (in->n_temperatures);
}

size_t thrust_input(const Inputs *in) {
    return in->sensors->has_thrust ? behind_temperatures(in) : SIZE_MAX;
}

size_t first_parameter(const Inputs *in) {
    return behind_temperatures(in) + (in->sensors->has_thrust ? 1 : 0) + (in->map->has_filter ? 1 : 0);
}

size_t first_parameter_std(const Inputs *in) {
    return first_parameter(in) + in->parameters->count;
}

size_t filter_setting(const Inputs *in) {
    return in->map->has_filter ? first_parameter(in) - 1 : SIZE_MAX;
}

size_t first_later(const Inputs *in) {
    return first_parameter_std(in) + (in->map->has_known ? in->parameters->count : 0);
}

size_t first_last(const Inputs *in) {
    return first_later(in) + N_LATER_INPUTS;
}

size_t first_inertial(const Inputs *in) {
    return first_last(in) + N_LAST_INPUTS;
}

size_t inputs_count(const Inputs *in) {
    return first_inertial(in) + in->n_inertial;
}

size_t parameter_beyond(const Inputs *in) {
    const FlowParameters *parameters = in->parameters;
    const double *value = in->value + first_parameter(in);
    for (size_t i = 0; i < parameters->count; i++) {
        if (value[i] != in->map->not_known && parameter_score(parameters, i, value[i]) > parameters->tolerance) {
            return i;
        }
    }
    return SIZE_MAX;
}

int inputs_parse(MapFile *file, Inputs *in) {
    const double largest = in->map->largest_zero;
    MAP_READ(file, "settings", ZERO_OFFSETS, Inputs, in);
    for (size_t i = 0; file->good && i < in->sensors->n_strains; i++) {
        map_require(file, fabs(in->zero_offset[i]) <= largest, "settings.zero_offset", "zeros in their range");
    }
    return file->good;
}

void inputs_reset(Inputs *in) {
    const size_t n = in->map->n_gauges;
    double *scalar = in->value + n;
    memset(in->value, 0, n * sizeof *in->value);
    memset(in->valid, 1, n);
    memset(in->given, 0, n);
    in->n_given = 0;
    memset(scalar, 0, (inputs_count(in) - n) * sizeof *scalar);
    scalar[DYNAMIC_PRESSURE] = in->map->has_tables ? 0.0 : in->map->dynamic_pressure;
    scalar[SENSOR_RANGE] = in->map->sensor_range;
    scalar[ALARM_SCALE] = 1.0;
    scalar[REFERENCE_AREA] = in->map->reference_area;
    scalar[REFERENCE_LENGTH] = in->map->reference_length;
    scalar[MOMENT_STATION] = in->map->moment_station;
    memcpy(scalar + N_ALL_SCALARS, in->zero_offset, in->sensors->n_strains * sizeof *scalar);
    for (size_t k = 0; k < in->parameters->count; k++) {
        in->value[first_parameter(in) + k] = in->map->not_known;
    }
    for (size_t k = 0; k < in->n_inertial; k++) {
        in->value[first_inertial(in) + k] = in->map->not_known;
    }
    in->value[first_last(in) + MEASURED_ATTACK] = in->value[first_last(in) + MEASURED_SIDESLIP] = in->map->not_known;
}

/* Whether value may be given to one of the zeros or their standard deviations, by its index among them. */
static int accepts_zero(const Inputs *in, size_t which, double value, char *text) {
    const size_t n = in->sensors->n_strains;
    const double largest = in->map->largest_zero, smallest = which < n ? -largest : 0.0;
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

static int accepts_time_constant(const Inputs *in, double value, char *text) {
    const double smallest = in->smallest_time, largest = in->largest_time;
    if (value == 0.0 || (value >= smallest && value <= largest)) {
        return 1;
    }
    snprintf(text, MODEL_TEXT_SIZE, "filter_time_constant: %g found, must be 0 or between %g and %g", value, smallest,
             largest);
    return 0;
}

int inputs_accept(const Inputs *in, size_t index, double value, char text[MODEL_TEXT_SIZE]) {
    if (index == filter_setting(in)) {
        return accepts_time_constant(in, value, text);
    }
    if (index >= first_temperature(in)) {
        return 1;
    }
    if (index >= in->map->n_gauges + N_ALL_SCALARS) {
        return accepts_zero(in, index - (in->map->n_gauges + N_ALL_SCALARS), value, text);
    }
    if (index < in->map->n_gauges + SENSOR_RANGE || index >= in->map->n_gauges + N_SCALAR_INPUTS) {
        return 1;
    }
    const size_t setting = index - in->map->n_gauges;
    const double largest = in->map->largest_setting, smallest = setting == MOMENT_STATION ? -largest : in->map->smallest_setting;
    if (value >= smallest && value <= largest) {
        return 1;
    }
    snprintf(text, MODEL_TEXT_SIZE, "%s: %g found, must be between %g and %g", SCALAR_NAMES[setting], value, smallest,
             largest);
    return 0;
}
