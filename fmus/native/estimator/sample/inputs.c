/* Inputs and settings of the estimator in one array: the place of each, its start value, and the values that it
   accepts.

       readings (n) | flow, settings, air data | zero offsets | temperatures | thrust | time constant | parameters | their
       standard deviations | later air data | last air data and angles | inertial unit

   Runs that a map does not have are empty, so that `first`, the place of each, depends on the map. New inputs stand at the end: numbers of
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

void inputs_lay_out(Inputs *in) {
    const size_t size[N_INPUT_RUNS] = {
        [READING_RUN] = in->map->n_gauges,
        [SCALAR_RUN] = N_ALL_SCALARS,
        [ZERO_RUN] = number_of_zeros(in->sensors->n_strains),
        [TEMPERATURE_RUN] = in->n_temperatures,
        [THRUST_RUN] = in->sensors->has_thrust ? 1 : 0,
        [TIME_CONSTANT_RUN] = in->map->has_filter ? 1 : 0,
        [PARAMETER_RUN] = in->parameters->count,
        [PARAMETER_STD_RUN] = in->map->has_known ? in->parameters->count : 0,
        [LATER_RUN] = N_LATER_INPUTS,
        [LAST_RUN] = N_LAST_INPUTS,
        [INERTIAL_RUN] = in->n_inertial,
    };
    for (size_t run = 0; run < N_INPUT_RUNS; run++) {
        in->first[run + 1] = in->first[run] + size[run];
    }
}

double known_parameter_score(const Inputs *in, size_t which) {
    const double value = in->value[in->first[PARAMETER_RUN] + which];
    return value == in->map->not_known ? 0.0 : parameter_score(in->parameters, which, value);
}

size_t parameter_beyond(const Inputs *in) {
    for (size_t i = 0; i < in->parameters->count; i++) {
        if (known_parameter_score(in, i) > in->parameters->tolerance) {
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
    memset(in->value, 0, in->first[N_INPUT_RUNS] * sizeof *in->value);
    memset(in->valid, 1, n);
    memset(in->given, 0, n);
    in->n_given = 0;
    scalar[DYNAMIC_PRESSURE] = in->map->has_tables ? 0.0 : in->map->dynamic_pressure;
    scalar[SENSOR_RANGE] = in->map->sensor_range;
    scalar[ALARM_SCALE] = 1.0;
    scalar[REFERENCE_AREA] = in->map->reference_area;
    scalar[REFERENCE_LENGTH] = in->map->reference_length;
    scalar[MOMENT_STATION] = in->map->moment_station;
    memcpy(scalar + N_ALL_SCALARS, in->zero_offset, in->sensors->n_strains * sizeof *scalar);
    for (size_t k = 0; k < in->parameters->count; k++) {
        in->value[in->first[PARAMETER_RUN] + k] = in->map->not_known;
    }
    for (size_t k = 0; k < in->n_inertial; k++) {
        in->value[in->first[INERTIAL_RUN] + k] = in->map->not_known;
    }
    in->value[in->first[LAST_RUN] + MEASURED_ATTACK] = in->value[in->first[LAST_RUN] + MEASURED_SIDESLIP] = in->map->not_known;
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
    const size_t setting = index - in->map->n_gauges;
    if (index == single_input(in, TIME_CONSTANT_RUN)) {
        return accepts_time_constant(in, value, text);
    }
    if (is_zero(in, index)) {
        return accepts_zero(in, index - in->first[ZERO_RUN], value, text);
    }
    if (index < in->map->n_gauges + SENSOR_RANGE || setting >= N_SCALAR_INPUTS) {
        return 1;
    }
    const double largest = in->map->largest_setting, smallest = setting == MOMENT_STATION ? -largest : in->map->smallest_setting;
    if (value >= smallest && value <= largest) {
        return 1;
    }
    snprintf(text, MODEL_TEXT_SIZE, "%s: %g found, must be between %g and %g", SCALAR_NAMES[setting], value, smallest,
             largest);
    return 0;
}
