/* The estimator as a model of the FMI fronts: its steps, values of its variables, derivatives, and the line of the
   log at a change of health.

   core/model.h states the contract. A variable is found by its number (estimator_variables.c); outputs are computed
   when they are read, inputs mark them as outdated. In model exchange whole numbers (health, counts, state of the
   tare) are discrete: `settled` holds them between events, and an event is asked for where they would change.
   docs/developers/native.md, "Variables" and "States, derivatives, messages". */

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "interface.h"

void model_destroy(Model *model) {
    if (model != NULL) {
        Estimator *e = estimator_of(model);
        const Memory memory = e->memory;
        free(e->bytes);
        memory_free(&memory);
    }
}

static Model *create(unsigned char *bytes, size_t length, char text[MODEL_TEXT_SIZE]) {
    Memory memory = {NULL, NULL, 0, 0};
    Estimator *e = estimator_create(&memory, bytes, length, text);
    if (e == NULL) {
        memory_free(&memory);
        free(bytes);
        return NULL;
    }
    e->bytes = bytes;
    e->base.time_reference = time_reference(e);
    e->inputs.angles_need_std = 1;
    return &e->base;
}

static void reset(Model *model) {
    estimator_reset(estimator_of(model));
    estimator_of(model)->reported_health = OK;
    estimator_of(model)->reported_angles = 0;
    memset(estimator_of(model)->settled, 0, sizeof estimator_of(model)->settled);
}

void model_set_time(Model *model, double time) {
    model->time = time;
}

/* Outputs are computed when they are read. They follow from inputs alone, outputs of the nonlinear estimator also from the
   flight state of the step before. */
static int step(Model *model, double start, double end, char text[MODEL_TEXT_SIZE]) {
    (void)text;
    Estimator *e = estimator_of(model);
    model->time = end;
    if (e->tare.up || e->tare.flags.is_up != 0.0) {
        estimator_follow_tare(e);
        estimator_take_readings(e);
    }
    estimator_step(e, start);
    return STATUS_OK;
}

static void follow_event(Model *model) {
    if (estimator_of(model)->tare.present) {
        estimator_follow_tare(estimator_of(model));
    }
}

static void accept_step(Model *model) {
    if (estimator_of(model)->tare.present) {
        estimator_take_readings(estimator_of(model));
    }
}

/* The whole numbers among the outputs, for the present inputs. */
static void whole_numbers(Estimator *e, double whole[N_WHOLE]) {
    const double *output = estimator_outputs(e);
    whole[0] = output[HEALTH_STATE];
    memcpy(whole + 1, output + VALID_GAUGES, (TARE_WHOLE - 1) * sizeof *whole);
    whole[TARE_WHOLE] = e->tare.present ? e->tare.flags.state : (double)TARE_IDLE;
}

static void settle(Model *model) {
    whole_numbers(estimator_of(model), estimator_of(model)->settled);
}

static int unsettled(Model *model) {
    Estimator *e = estimator_of(model);
    double present[N_WHOLE];
    whole_numbers(e, present);
    return memcmp(present, e->settled, sizeof present) != 0;
}

/* Why no gauge is in use, where health is INVALID. */
static const char *why_invalid(const Estimator *e) {
    const double range = e->inputs.value[e->map.n_gauges + SENSOR_RANGE];
    size_t usable = 0;
    for (size_t i = 0; i < e->map.n_gauges; i++) {
        usable += gauge_in_use(&e->inputs, i, range);
    }
    return e->inputs.n_given == 0 ? "; no strain was set" : usable > 0 ? "; all strains are exactly 0" : "";
}

/* The first angle that is no 0 of an unconnected input, without a standard deviation. */
static int lone_angle(const Inputs *inputs, char text[MODEL_TEXT_SIZE]) {
    static const char *const NAMES[] = {LAST_INPUTS(AIR_INPUT_NAME)};
    static const size_t ANGLES[] = {MEASURED_ATTACK, MEASURED_SIDESLIP};
    for (size_t k = 0; k < sizeof ANGLES / sizeof *ANGLES; k++) {
        const double given = given_angle(inputs, ANGLES[k]);
        if (isfinite(given) && given != 0.0 && isnan(measured_angle(inputs, ANGLES[k]))) {
            snprintf(text, MODEL_TEXT_SIZE, "%s = %g rad does not count: %s must be above 0", NAMES[ANGLES[k]], given,
                     NAMES[ANGLES[k] + 1]);
            return 1;
        }
    }
    return 0;
}

/* The end of a tare, an angle without standard deviation, or a change of health. */
static int event(Model *model, char text[MODEL_TEXT_SIZE]) {
    Estimator *e = estimator_of(model);
    if (e->tare.to_report) {
        e->tare.to_report = 0;
        memcpy(text, e->tare.text, sizeof e->tare.text);
        return 1;
    }
    if (!e->reported_angles && lone_angle(&e->inputs, text)) {
        e->reported_angles = 1;
        return 1;
    }
    const double *output = estimator_outputs(e);
    const int health = (int)output[HEALTH_STATE];
    if (health == e->reported_health) {
        return 0;
    }
    snprintf(text, MODEL_TEXT_SIZE,
             "health %s at %g s: %.0f gauges in use, chi-square %.4g (limit %.4g), suspect gauge %.0f",
             HEALTH_NAMES[health], model->time, output[VALID_GAUGES], output[CHI_SQUARE], output[CHI_SQUARE_LIMIT], output[SUSPECT_GAUGE]);
    const size_t outside = health == OUTSIDE ? parameter_beyond(&e->inputs) : SIZE_MAX, used = strlen(text);
    if (health == INVALID) {
        snprintf(text + used, MODEL_TEXT_SIZE - used, "%s", why_invalid(e));
    }
    if (outside != SIZE_MAX) {
        snprintf(text + used, MODEL_TEXT_SIZE - used, "; %s = %g is outside %g to %g",
                 e->parameters.names + outside * PARAMETER_NAME_SIZE, e->inputs.value[e->inputs.first[PARAMETER_RUN] + outside],
                 e->parameters.minimum[outside], e->parameters.maximum[outside]);
    }
    const int axis = health == INCONSISTENT ? estimator_contradicted_force(e) : 0;
    if (axis != 0) {
        const double force = output[LOADS + 3 - axis] / e->thermal.map.vehicle_mass;
        snprintf(text + used, MODEL_TEXT_SIZE - used, "; specific_force_%c: expected about %.3g m/s2 by load and mass, got %.3g",
                 " yz"[axis], force, e->inputs.value[e->inputs.first[INERTIAL_RUN] + (size_t)axis]);
    }
    if (health == DEGRADED && renewal_pending(e)) {
        snprintf(text + used, MODEL_TEXT_SIZE - used, "; matrices for other deviations of zeros are being made");
    }
    if (health == DEGRADED && thermal_vibrates(&e->thermal)) {
        snprintf(text + used, MODEL_TEXT_SIZE - used, "; vibration of %.3g um/m", 1e6 * known_vibration(&e->inputs));
    }
    e->reported_health = health;
    return 1;
}

/* A whole number among the outputs, which is discrete in model exchange. */
static double whole_value(Estimator *e, size_t place) {
    double present[N_WHOLE];
    whole_numbers(e, present);
    return e->base.mode == CONTINUOUS_TIME ? e->settled[place] : present[place];
}

/* The present value of a variable; of a truth value 0 or 1. */
static double value_of(Estimator *e, Variable variable) {
    const size_t place = variable.place;
    const double *output = variable.kind <= OTHER_LOAD ? estimator_outputs(e) : NULL;
    switch (variable.kind) {
    case OUTPUT:
        if (variable_type(e, variable) != REAL) {
            return whole_value(e, place == HEALTH_STATE ? 0 : place - VALID_GAUGES + 1);
        }
        return output[place];
    case INPUT:
        if (variable_type(e, variable) == ENUMERATION) {
            const double stated = known_of(&e->inputs, LAST_RUN, Q_SOURCE); /* NaN for AUTO */
            return stated <= (double)MACH_AND_ALTITUDE ? stated : (double)AUTO;
        }
        return e->inputs.value[place];
    case VALID: return e->inputs.valid[place];
    case AIR_DATA: return e->flight.real[place];
    case FLIGHT_FLAG: return e->flight.flag[place];
    case TARE_INPUT: return e->tare.up;
    case TARE_STATE: return whole_value(e, TARE_WHOLE);
    case ZERO_IN_USE: return zeros_in_use(e)[place];
    case SCORE: return known_parameter_score(&e->inputs, place);
    case USABLE: return is_usable(whole_value(e, 0));
    default: return other_loads_of(e)[place];
    }
}

static int get(Model *model, Type type, const Selection *which, void *value, char text[MODEL_TEXT_SIZE]) {
    Estimator *e = estimator_of(model);
    const size_t count = which->count;
    if (type == REAL && which->listed == NULL && which->first < HEALTH_STATE && count <= HEALTH_STATE - which->first) {
        memcpy(value, estimator_outputs(e) + which->first, count * sizeof(double));
        return 1;
    }
    for (size_t k = 0; k < count; k++) {
        const Variable variable = variable_of(e, selected(which, k));
        if (!is_read_as(variable_type(e, variable), type)) {
            snprintf(text, MODEL_TEXT_SIZE, WRONG_TYPE, (unsigned long)selected(which, k));
            return 0;
        }
        put_value(type, value, k, value_of(e, variable));
    }
    return 1;
}

/* Give an input a value. 1; 0, after a message, if it is refused. */
static int set_value(Estimator *e, Variable variable, Type type, double value, char *text) {
    if (variable.kind == TARE_INPUT) {
        e->tare.up = value != 0.0;
        return 1;
    }
    if (type == INTEGER && !(value >= AUTO && value <= MACH_AND_ALTITUDE)) {
        snprintf(text, MODEL_TEXT_SIZE, "q_source: %.0f found, must be from %d to %d", value, AUTO, MACH_AND_ALTITUDE);
        return 0;
    }
    if (type == REAL) {
        return estimator_set_input(e, variable.place, value, text);
    }
    estimator_before_change(e);
    if (variable.kind == VALID) {
        e->inputs.valid[variable.place] = value != 0.0;
    } else {
        e->inputs.value[variable.place] = value;
    }
    return 1;
}

static int set(Model *model, Type type, const Selection *which, const void *value, char text[MODEL_TEXT_SIZE]) {
    static const char *const NAMES[] = {[REAL] = "real", [INTEGER] = "integer", [BOOLEAN] = "Boolean", [TEXT] = "String"};
    Estimator *e = estimator_of(model);
    const size_t n = e->map.n_gauges, count = which->count, gauge = which->first - N_OUTPUTS;
    if (type == REAL) {
        estimator_before_change(e);
    }
    if (type == REAL && which->listed == NULL && gauge < n && count <= n - gauge) {
        memcpy(e->inputs.value + gauge, value, count * sizeof(double));
        readings_note_given(&e->inputs, gauge, gauge + count);
        return 1;
    }
    for (size_t k = 0; k < count; k++) {
        const Variable variable = variable_of(e, selected(which, k));
        const int is_input = variable.kind == INPUT || variable.kind == VALID || variable.kind == TARE_INPUT;
        if (!is_input || !is_read_as(variable_type(e, variable), type)) {
            snprintf(text, MODEL_TEXT_SIZE, "variable %lu is no %s input or parameter", (unsigned long)selected(which, k), NAMES[type]);
            return 0;
        }
        if (!set_value(e, variable, type, value_at(type, value, k), text)) {
            return 0;
        }
    }
    return 1;
}

/* Derivatives: of loads, coefficients and air data; the sigmas of zeros, the time constant of the filter and the source
   of the dynamic pressure have none. */

static size_t input_index(const Model *model, size_t number) {
    const Estimator *e = estimator_of(model);
    const Variable variable = variable_of(e, number);
    const size_t first_std = e->inputs.first[ZERO_RUN] + e->sensors.n_strains;
    const int none = (variable.place >= first_std && variable.place < e->inputs.first[TEMPERATURE_RUN])
                  || variable.place == single_input(&e->inputs, TIME_CONSTANT_RUN);
    return variable.kind != INPUT || variable_type(e, variable) != REAL || none ? SIZE_MAX : variable.place;
}

static size_t output_index(const Model *model, size_t number) {
    const Estimator *e = estimator_of(model);
    const Variable variable = variable_of(e, number);
    const size_t place = variable.place, values = variable.kind == OTHER_LOAD ? place / e->other_loads.map.n_loads : 0;
    switch (variable.kind) {
    case OUTPUT: return place < COEFFICIENTS_STD || (place >= LOADS && place < LOADS_STD) ? place : SIZE_MAX;
    case AIR_DATA: return place < N_AIR_DATA ? N_OUTPUTS + place : SIZE_MAX;
    case OTHER_LOAD:
        return values == OTHER_LOADS || values == OTHER_COEFFICIENTS ? N_OUTPUTS + N_FLIGHT_REALS + place : SIZE_MAX;
    default: return SIZE_MAX;
    }
}

static double *clear_direction(Model *model) {
    Estimator *e = estimator_of(model);
    return memset(e->direction, 0, e->inputs.first[N_INPUT_RUNS] * sizeof *e->direction);
}

static const double *along_direction(Model *model, char text[MODEL_TEXT_SIZE]) {
    Estimator *e = estimator_of(model);
    return estimator_derivative(e, e->direction, e->derivative, text) ? e->derivative : NULL;
}

const ModelFacts MODEL = {
    .resource = "map.bin",
    .content = "map",
    .foreign_state = "is that of an FMU with another map",
    .model_exchange = 1,
    .input_index = input_index,
    .output_index = output_index,
    .clear_direction = clear_direction,
    .along_direction = along_direction,
    .create = create,
    .reset = reset,
    .step = step,
    .follow_event = follow_event,
    .accept_step = accept_step,
    .settle = settle,
    .unsettled = unsettled,
    .event = event,
    .get = get,
    .set = set,
};
