/* Inputs and settings of the estimator in one array: the place of each, its start value, and the values that it
   accepts.

       readings (n) | flow, settings, air data | zero offsets | temperatures | thrust | time constant | parameters | their
       standard deviations | later air data | last air data and angles | inertial unit

   Runs that a map does not have are empty, so that `first`, the place of each, depends on the map. New inputs stand at the end: numbers of
   variables of exported FMUs stay. Strain, pressures and temperatures accept any value, since health reports what
   makes no sense; settings and zero offsets have bounds, since nothing else would notice a wrong one.
   docs/developers/native.md, "Variables" and "Gauges, zero offsets, temperatures". */

#include "sample.h"

#include <stdio.h>
#include <string.h>

#include "../../core/elementary.h"

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

void moment_transfer(const Inputs *in, const double *scale, double transfer[N_LOADS][N_LOADS]) {
    const double shift = moment_shift(in);
    memset(transfer, 0, N_LOADS * N_LOADS * sizeof(double));
    for (size_t i = 0; i < N_LOADS; i++) {
        transfer[i][i] = scale[i];
        if (i >= N_FORCES) {
            transfer[i][i - 2] = shift * scale[i];
        }
    }
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

/* Readings of a sample: which of them are used, and the rows of strain that they stand for.

   A reading is used where the caller trusts it, it was set, and it is a number within its range (NaN fails every
   comparison). If all of them that may be used are exactly 0 in a flow, no gauge is connected: none is used. A row
   is the reading less its zero offset; of an auxiliary sensor the reading less what thrust makes of it, over its
   scale. Thermal strain is subtracted afterwards (temperature/thermal.c). docs/developers/native.md, "Gauges, zero
   offsets, temperatures". */

/* What another sensor, by its number behind the strain gauges, reads [unit], less what thrust [N] makes of it. */
static double sensor_reading(const Inputs *in, size_t which) {
    const size_t place = single_input(in, THRUST_RUN);
    const double thrust = place == SIZE_MAX ? 0.0 : in->value[place], response = in->sensors->thrust_response[which];
    const double reading = in->value[in->sensors->n_strains + which];
    return response == 0.0 ? reading : reading - (thrust == in->map->not_known ? NAN : thrust) * response;
}

/* Whether what another sensor reads is a number within its range. */
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

/* Air data of a sample: what a dynamic pressure is computed from, and its standard deviation then.

   q = gamma/2 M^2 p: where it is computed from M and a pressure it adds no information, and its relative error is,
   to first order,

       (s_q / q)^2 = (2 s_M / M)^2 + (s_p / p)^2.

   The input q_source states the source; without it a q_inf that comes with M counts as computed, from p_inf where
   that is given, else from the standard atmosphere at the altitude. A stated standard deviation smaller than by
   these sources then counts only where the source is stated too. docs/howto/settings_and_health.md, "State where
   q_inf comes from"; strainfmu/estimator/reference/air.py. */

double pressure_by_altitude(const Inputs *inputs) {
    const double altitude = known_input(inputs, ALTITUDE), found = ambient_pressure(&inputs->map->envelope, altitude);
    return isnan(found) && !isnan(altitude) ? 0.0 : found;
}

double computed_pressure_error(double mach, double mach_std, double pressure_std) {
    const double of_mach = 2.0 * mach_std / mach;
    return sqrt(of_mach * of_mach + pressure_std * pressure_std);
}

double computed_pressure_std(const Inputs *inputs, double stated, double own) {
    const int is_decided = known_of(inputs, LAST_RUN, Q_SOURCE) > 0.5;
    return isnan(stated) || (!is_decided && stated < own) ? own : stated;
}

PressureSource pressure_source(const Inputs *inputs) {
    const double stated = known_of(inputs, LAST_RUN, Q_SOURCE);
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
    const double stated[2] = {known_of(inputs, LAST_RUN, MEASURED_ATTACK_STD), known_of(inputs, LAST_RUN, MEASURED_SIDESLIP_STD)};
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
