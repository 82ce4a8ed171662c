/* The estimator as a model: its variables by number, its derivatives, its state.

   Numbers are outputs, strains, valid flags, then the scalar inputs and settings; of maps with tables over the flight
   state then further inputs, real outputs and Boolean outputs; then the zeros and their deviations. */

#include <stdio.h>
#include <string.h>

#include "../core/model.h"
#include "estimator.h"

#define LINEAR_REFERENCES 24u /* arrays of FMI 3.0 of a map without tables; time follows them */
#define FLIGHT_REFERENCES (N_FLIGHT_INPUTS + N_FLIGHT_REALS + N_FLIGHT_FLAGS)
#define ZERO_REFERENCES 3u   /* zero, zero_std, zero_common_std */

static Estimator *estimator_of(const Model *model) {
    return (Estimator *)(uintptr_t)model; /* its first member */
}

static size_t n_inputs(const Estimator *e) {
    return e->map.n_gauges + N_ALL_SCALARS + number_of_zeros(e->map.n_gauges);
}

/* Number of the first of the zeros. */
static size_t first_zero(const Estimator *e) {
    return N_OUTPUTS + 2 * e->map.n_gauges + N_SCALAR_INPUTS + (e->flight.present ? FLIGHT_REFERENCES : 0);
}

/* Value reference of FMI 3.0 of the first of the zeros. */
static unsigned zero_reference(const Estimator *e) {
    return LINEAR_REFERENCES + (e->flight.present ? FLIGHT_REFERENCES : 0);
}

/* Number of a variable among those of the nonlinear estimator; SIZE_MAX for any other. */
static size_t flight_variable(const Estimator *e, size_t variable) {
    const size_t number = variable - (N_OUTPUTS + 2 * e->map.n_gauges + N_SCALAR_INPUTS);
    return e->flight.present && number < FLIGHT_REFERENCES ? number : SIZE_MAX;
}

/* Index of a variable among the real outputs, and among the flags, of the nonlinear estimator; SIZE_MAX for others. */
static size_t flight_real(const Estimator *e, size_t variable) {
    const size_t number = flight_variable(e, variable) - N_FLIGHT_INPUTS;
    return number < N_FLIGHT_REALS ? number : SIZE_MAX;
}

static size_t flight_flag(const Estimator *e, size_t variable) {
    const size_t number = flight_variable(e, variable) - (N_FLIGHT_INPUTS + N_FLIGHT_REALS);
    return number < N_FLIGHT_FLAGS ? number : SIZE_MAX;
}

void model_destroy(Model *model) {
    estimator_free(estimator_of(model));
}

Model *model_create(unsigned char *bytes, size_t length, char text[MODEL_TEXT_SIZE]) {
    Estimator *e = estimator_create(bytes, length, text);
    if (e == NULL) {
        return NULL;
    }
    e->base = (Model){.guid = e->map.guid,
                      .checksum = e->map.checksum,
                      .mode = INSTANTIATED,
                      .co_simulation_only = e->flight.present,
                      .time_reference = zero_reference(e) + ZERO_REFERENCES};
    return &e->base;
}

void model_reset(Model *model) {
    estimator_reset(estimator_of(model));
    estimator_of(model)->reported_health = OK;
    memset(estimator_of(model)->settled, 0, sizeof estimator_of(model)->settled);
}

void model_set_time(Model *model, double time) {
    model->time = time;
}

/* Outputs are right at any time. */
void model_end_initialization(Model *model) {
    (void)model;
}

/* Outputs are computed when they are read. They follow from inputs alone, those of the nonlinear estimator also from the
   flight state of the step before. */
int model_step(Model *model, double start, double end, char text[MODEL_TEXT_SIZE]) {
    (void)start;
    (void)text;
    model->time = end;
    if (estimator_of(model)->flight.present) {
        flight_step(estimator_of(model));
    }
    return STATUS_OK;
}

/* The whole numbers among the outputs, for the present inputs. */
static void whole_numbers(Estimator *e, double whole[N_WHOLE]) {
    const double *output = estimator_outputs(e);
    whole[0] = output[HEALTH_STATE];
    memcpy(whole + 1, output + VALID_GAUGES, (N_WHOLE - 1) * sizeof *whole);
}

void model_settle(Model *model) {
    whole_numbers(estimator_of(model), estimator_of(model)->settled);
}

int model_unsettled(Model *model) {
    Estimator *e = estimator_of(model);
    double present[N_WHOLE];
    whole_numbers(e, present);
    return memcmp(present, e->settled, sizeof present) != 0;
}

/* A change of health. */
int model_event(Model *model, char text[MODEL_TEXT_SIZE]) {
    static const char *const STATES[] = {
        "OK", "INCONSISTENT", "NO_COEFFICIENTS", "INVALID", "DEGRADED", "UNIDENTIFIED", "SUSPECT", "OUTSIDE",
    };
    Estimator *e = estimator_of(model);
    const double *output = estimator_outputs(e);
    const int health = (int)output[HEALTH_STATE];
    if (health == e->reported_health) {
        return 0;
    }
    snprintf(text, MODEL_TEXT_SIZE,
             "health %s at %g s: %.0f gauges in use, chi-square %.4g (limit %.4g), suspect gauge %.0f", STATES[health],
             model->time, output[VALID_GAUGES], output[CHI_SQUARE], output[CHI_SQUARE_LIMIT], output[SUSPECT_GAUGE]);
    e->reported_health = health;
    return 1;
}

/* Variables. */

static int is_real_output(size_t variable) {
    return variable < HEALTH_STATE || variable == CHI_SQUARE || variable == CHI_SQUARE_LIMIT
        || variable == ENVELOPE_SCORE;
}

/* Index of a real input or setting in estimator->input; SIZE_MAX for any other variable. */
static size_t input_of(const Estimator *e, size_t variable) {
    const size_t n = e->map.n_gauges;
    if (variable - N_OUTPUTS < n) { /* size_t: outputs wrap round to large numbers */
        return variable - N_OUTPUTS;
    }
    const size_t scalar = variable - (N_OUTPUTS + 2 * n), zero = variable - first_zero(e);
    if (zero < number_of_zeros(n)) {
        return n + N_ALL_SCALARS + zero;
    }
    return scalar < (e->flight.present ? N_ALL_SCALARS : N_SCALAR_INPUTS) ? n + scalar : SIZE_MAX;
}

Type model_type_of(const Model *model, size_t variable) {
    const Estimator *e = estimator_of(model);
    if (is_real_output(variable) || input_of(e, variable) != SIZE_MAX || flight_real(e, variable) != SIZE_MAX) {
        return REAL;
    }
    if (variable < N_OUTPUTS) {
        return variable == HEALTH_STATE ? ENUMERATION : INTEGER;
    }
    const int flag = variable - (N_OUTPUTS + e->map.n_gauges) < e->map.n_gauges || flight_flag(e, variable) != SIZE_MAX;
    return flag ? BOOLEAN : NO_VARIABLE;
}

/* Each array follows the one before it without a gap. */
Selection model_array(const Model *model, unsigned reference) {
    static const unsigned char FIRST[] = {
        0,  5,                      /* coefficients, sigma_coefficients */
        10, 13, 15, 18,             /* forces, moments, sigma_forces, sigma_moments */
        20, 21, 22, 23, 24, 25, 26, /* health.state, .chi_square, .chi_square_limit, .valid_gauges, ... */
        N_OUTPUTS,                  /* strain; valid, then scalar inputs and settings */
    };
    const size_t n = estimator_of(model)->map.n_gauges, strain = sizeof FIRST - 1;
    Selection found = {NULL, 0, 0};
    if (reference < strain) {
        found.first = FIRST[reference];
        found.count = (size_t)FIRST[reference + 1] - found.first;
    } else if (reference < strain + 2) {
        found.first = N_OUTPUTS + (reference - strain) * n;
        found.count = n;
    } else if (reference < zero_reference(estimator_of(model))) {
        found.first = N_OUTPUTS + 2 * n + (reference - strain - 2);
        found.count = 1;
    } else if (reference < model->time_reference) {
        const size_t which = reference - zero_reference(estimator_of(model));
        found.first = first_zero(estimator_of(model)) + which * n;
        found.count = which < 2 ? n : 1;
    }
    return found;
}

static int wrong_type(size_t variable, char *text) {
    snprintf(text, MODEL_TEXT_SIZE, WRONG_TYPE, (unsigned long)variable);
    return 0;
}

int model_get_reals(Model *model, const Selection *which, double *value, char text[MODEL_TEXT_SIZE]) {
    Estimator *e = estimator_of(model);
    const size_t count = which->count;
    if (which->listed == NULL && which->first < HEALTH_STATE && count <= HEALTH_STATE - which->first) {
        memcpy(value, estimator_outputs(e) + which->first, count * sizeof *value);
        return 1;
    }
    for (size_t k = 0; k < count; k++) {
        const size_t variable = selected(which, k), input = input_of(e, variable);
        if (input != SIZE_MAX) {
            value[k] = e->input[input];
        } else if (is_real_output(variable)) {
            value[k] = estimator_outputs(e)[variable];
        } else if (flight_real(e, variable) != SIZE_MAX) {
            estimator_outputs(e);
            value[k] = e->flight.real[flight_real(e, variable)];
        } else {
            return wrong_type(variable, text);
        }
    }
    return 1;
}

int model_get_integers(Model *model, const Selection *which, int *value, char text[MODEL_TEXT_SIZE]) {
    Estimator *e = estimator_of(model);
    double present[N_WHOLE];
    const double *whole = model->mode == CONTINUOUS_TIME ? e->settled : present;
    whole_numbers(e, present);
    for (size_t k = 0; k < which->count; k++) {
        const size_t variable = selected(which, k);
        if (variable != HEALTH_STATE && !(variable >= VALID_GAUGES && variable <= SUSPECTS)) {
            return wrong_type(variable, text);
        }
        value[k] = (int)whole[variable == HEALTH_STATE ? 0 : variable - VALID_GAUGES + 1];
    }
    return 1;
}

int model_get_booleans(Model *model, const Selection *which, int *value, char text[MODEL_TEXT_SIZE]) {
    Estimator *e = estimator_of(model);
    for (size_t k = 0; k < which->count; k++) {
        const size_t variable = selected(which, k), gauge = variable - (N_OUTPUTS + e->map.n_gauges);
        if (gauge < e->map.n_gauges) {
            value[k] = e->valid[gauge];
        } else if (flight_flag(e, variable) != SIZE_MAX) {
            estimator_outputs(e);
            value[k] = e->flight.flag[flight_flag(e, variable)];
        } else {
            return wrong_type(variable, text);
        }
    }
    return 1;
}

static int no_input(const char *type, size_t variable, char *text) {
    snprintf(text, MODEL_TEXT_SIZE, "variable %lu is no %s input or parameter", (unsigned long)variable, type);
    return 0;
}

int model_set_reals(Model *model, const Selection *which, const double *value, char text[MODEL_TEXT_SIZE]) {
    Estimator *e = estimator_of(model);
    const size_t n = e->map.n_gauges, count = which->count, gauge = which->first - N_OUTPUTS;
    flight_before_change(e);
    if (which->listed == NULL && gauge < n && count <= n - gauge) {
        memcpy(e->input + gauge, value, count * sizeof *value);
        return 1;
    }
    for (size_t k = 0; k < count; k++) {
        const size_t variable = selected(which, k), input = input_of(e, variable);
        if (input == SIZE_MAX) {
            return no_input("real", variable, text);
        }
        if (input >= n && !estimator_accepts(e, input, value[k], text)) {
            return 0;
        }
        e->input[input] = value[k];
        e->noise_outdated |= input >= n + N_ALL_SCALARS + n;
    }
    return 1;
}

int model_set_integers(Model *model, const Selection *which, const int *value, char text[MODEL_TEXT_SIZE]) {
    (void)model;
    (void)value;
    return which->count == 0 ? 1 : no_input("integer", selected(which, 0), text);
}

int model_set_booleans(Model *model, const Selection *which, const int *value, char text[MODEL_TEXT_SIZE]) {
    Estimator *e = estimator_of(model);
    for (size_t k = 0; k < which->count; k++) {
        const size_t variable = selected(which, k), gauge = variable - (N_OUTPUTS + e->map.n_gauges);
        if (gauge >= e->map.n_gauges) {
            return no_input("Boolean", variable, text);
        }
        flight_before_change(e);
        e->valid[gauge] = value[k] != 0;
    }
    return 1;
}

/* Derivatives, which the nonlinear estimator does not offer, and which the deviations of zeros do not have. */

static size_t input_index(const Model *model, size_t variable) {
    const Estimator *e = estimator_of(model);
    const size_t input = input_of(e, variable), first_std = 2 * e->map.n_gauges + N_ALL_SCALARS;
    return e->flight.present || input >= first_std ? SIZE_MAX : input;
}

static size_t output_index(const Model *model, size_t variable) {
    return is_real_output(variable) && !estimator_of(model)->flight.present ? variable : SIZE_MAX;
}

static double *clear_direction(Model *model) {
    Estimator *e = estimator_of(model);
    return memset(e->direction, 0, n_inputs(e) * sizeof *e->direction);
}

static const double *along_direction(Model *model) {
    Estimator *e = estimator_of(model);
    for (size_t i = 0; i < e->map.n_gauges; i++) {
        e->direction[i] -= e->direction[e->map.n_gauges + N_ALL_SCALARS + i]; /* of the zero of that gauge */
    }
    estimator_derivative(e, e->direction, e->derivative);
    return e->derivative;
}

/* State: inputs and settings, then the whole numbers of the last event, as float64; a byte per gauge for valid. Masks
   and outputs follow from them; those of the nonlinear estimator also from its track, which comes last. */

static size_t linear_size(const Estimator *e) {
    return sizeof(double) * (n_inputs(e) + N_WHOLE) + e->map.n_gauges;
}

size_t model_state_size(const Model *model) {
    const Estimator *e = estimator_of(model);
    return linear_size(e) + (e->flight.present ? sizeof(Track) : 0);
}

void model_write_state(const Model *model, unsigned char *bytes) {
    const Estimator *e = estimator_of(model);
    if (e->flight.present) {
        memcpy(bytes + linear_size(e), &e->flight.base, sizeof e->flight.base);
    }
    memcpy(bytes, e->input, sizeof(double) * n_inputs(e));
    bytes += sizeof(double) * n_inputs(e);
    memcpy(bytes, e->settled, sizeof e->settled);
    memcpy(bytes + sizeof e->settled, e->valid, e->map.n_gauges);
}

int model_check_state(const Model *model, const unsigned char *bytes, char text[MODEL_TEXT_SIZE]) {
    const Estimator *e = estimator_of(model);
    for (size_t i = 0; i < n_inputs(e); i++) {
        double value;
        memcpy(&value, bytes + sizeof value * i, sizeof value);
        if (!estimator_accepts(e, i, value, text)) {
            snprintf(text, MODEL_TEXT_SIZE, "holds a setting that is not allowed");
            return 0;
        }
    }
    for (size_t i = 0; i < N_WHOLE; i++) {
        double whole;
        memcpy(&whole, bytes + sizeof whole * (n_inputs(e) + i), sizeof whole);
        if (!(whole >= 0.0 && whole <= (double)(i == 0 ? OUTSIDE : e->map.n_gauges))) {
            snprintf(text, MODEL_TEXT_SIZE, "holds a health or a number of gauges that there is not");
            return 0;
        }
    }
    for (size_t i = 0; i < e->map.n_gauges; i++) {
        if (bytes[sizeof(double) * (n_inputs(e) + N_WHOLE) + i] > 1) {
            snprintf(text, MODEL_TEXT_SIZE, "holds a gauge that is neither valid nor not");
            return 0;
        }
    }
    if (e->flight.present) {
        Track track;
        memcpy(&track, bytes + linear_size(e), sizeof track);
        if (!flight_track_fits(&e->flight, &track)) {
            snprintf(text, MODEL_TEXT_SIZE, "holds a flight state that cannot be");
            return 0;
        }
    }
    return 1;
}

void model_read_state(Model *model, const unsigned char *bytes) {
    Estimator *e = estimator_of(model);
    if (e->flight.present) {
        memcpy(&e->flight.base, bytes + linear_size(e), sizeof e->flight.base);
    }
    memcpy(e->input, bytes, sizeof(double) * n_inputs(e));
    bytes += sizeof(double) * n_inputs(e);
    memcpy(e->settled, bytes, sizeof e->settled);
    memcpy(e->valid, bytes + sizeof e->settled, e->map.n_gauges);
    e->outdated = e->noise_outdated = 1;
}

static const Derivatives DERIVATIVES = {
    .input_index = input_index,
    .output_index = output_index,
    .clear_direction = clear_direction,
    .along_direction = along_direction,
};

const ModelFacts MODEL = {
    .resource = "map.bin",
    .content = "map",
    .foreign_state = "is that of an FMU with another map",
    .model_exchange = 1,
    .derivatives = &DERIVATIVES,
};
