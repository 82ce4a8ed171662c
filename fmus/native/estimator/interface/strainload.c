/* The estimator without FMI: samples and results are records of float64 values, described field by field.

   A record lists its fields (name, position, length) for a map; Python and other callers find values by name, so
   that a new field is one line here. A sample is copied to the estimator's inputs by runs: stretches of the record
   that lie in one piece among the inputs. Each function that computes does so in the default floating-point
   environment and restores the host's (core/floating.h). A series is a loop over samples, each by itself (SL_EACH)
   or from what the one before it left (SL_TRACK). docs/howto/run_without_fmi.md; strainload.h states the functions. */

#include "interface.h"
#include "strainload.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "../../core/floating.h"

#define MAX_FIELDS 32
#define N_RECORDS (SL_TARE + 1)
#define N_RUNS 9 /* of a sample */
#define STACK_SIZE 16384 /* measured: 10,000 bytes on x86-64 and aarch64; fmus/c/measure.c ends with an error above it */
#define STANDARD_GRAVITY 9.80665 /* [m/s2] */

/* Fields of a record. */
typedef struct {
    size_t count, size;
    SlField field[MAX_FIELDS];
} Record;

/* A run of the estimator's inputs, and its place in the record of a sample or of the settings. */
typedef struct {
    size_t first, input, count;
} Run;

struct StrainLoad {
    Model *model;
    Estimator *estimator;
    size_t copied; /* bytes of the map's copy */
    Record record[N_RECORDS];
    Run sample[N_RUNS + 1], setting[8]; /* that end with a run of no inputs */
    Tare whole, steps;         /* of a window at once, and by steps: the estimator's own is its FMU's */
};

static void add_field(Record *record, const char *name, size_t count) {
    SlField *field = &record->field[record->count++];
    snprintf(field->name, sizeof field->name, "%s", name);
    field->first = record->size;
    field->count = count;
    record->size += count;
}

#define ADD_FIELD(place, name, count) add_field(record, name, count);

/* Describe a run of inputs by the names of its fields, all of one length. */
static Run *add_run(Record *record, Run *run, size_t input, size_t each, size_t n_names, const char *const *names) {
    *run = (Run){record->size, input, each * n_names};
    for (size_t k = 0; k < n_names; k++) {
        add_field(record, names[k], each);
    }
    return run + 1;
}

/* Readings, then what is known of air, temperature and flow. */
static void describe_inputs(StrainLoad *handle) {
    static const char *const MORE[] = {NAVIGATION_INPUTS(AIR_INPUT_NAME)};
    static const char *const LATER[] = {LATER_INPUTS(AIR_INPUT_NAME) LAST_INPUTS(AIR_INPUT_NAME) NULL};
    static const char *const READINGS[] = {"strain", "sensor"};
    static const char *const INERTIAL[] = {INERTIAL_INPUTS(AIR_INPUT_NAME) NULL};
    static const char *const TEMPERATURE[] = {"temperature"}, *const THRUST[] = {"thrust"};
    static const char *const PARAMETERS[] = {"parameter", "parameter_std"};
    const Estimator *e = handle->estimator;
    const size_t n = e->map.n_gauges, n_strains = e->sensors.n_strains, *first = e->inputs.first;
    Record *record = &handle->record[SL_INPUTS];
    Run *run = add_run(record, handle->sample, 0, n_strains, 1, READINGS);
    run = add_run(record, run, n_strains, n - n_strains, 1, READINGS + 1);
    run = add_run(record, run, n, 1, N_FLOW_INPUTS, SCALAR_NAMES);
    run = add_run(record, run, n + N_SCALAR_INPUTS, 1, N_NAVIGATION_INPUTS, MORE);
    run = add_run(record, run, first[LATER_RUN], 1, N_LATER_INPUTS + N_LAST_INPUTS, LATER);
    run = add_run(record, run, first[TEMPERATURE_RUN], e->inputs.n_temperatures, 1, TEMPERATURE);
    run = add_run(record, run, first[THRUST_RUN], first[THRUST_RUN + 1] - first[THRUST_RUN], 1, THRUST);
    run = add_run(record, run, first[PARAMETER_RUN], e->parameters.count, e->map.has_known ? 2 : 1, PARAMETERS);
    run = add_run(record, run, first[INERTIAL_RUN], e->inputs.n_inertial > 0 ? 1 : 0, N_INERTIAL_INPUTS, INERTIAL);
    *run = (Run){0, 0, 0};
}

static void describe_settings(StrainLoad *handle) {
    static const char *const ZEROS[] = {"zero", "zero_std"}, *const COMMON[] = {"zero_common_std"};
    static const char *const FILTER[] = {"filter_time_constant"};
    const Estimator *e = handle->estimator;
    const size_t n = e->map.n_gauges, n_strains = e->sensors.n_strains, *first = e->inputs.first;
    Record *record = &handle->record[SL_SETTINGS];
    Run *run = add_run(record, handle->setting, n + SENSOR_RANGE, 1, N_SCALAR_INPUTS - SENSOR_RANGE, SCALAR_NAMES + SENSOR_RANGE);
    run = add_run(record, run, first[ZERO_RUN], n_strains, 2, ZEROS);
    run = add_run(record, run, first[ZERO_RUN] + 2 * n_strains, 1, 1, COMMON);
    run = add_run(record, run, first[TIME_CONSTANT_RUN], first[TIME_CONSTANT_RUN + 1] - first[TIME_CONSTANT_RUN], 1, FILTER);
    *run = (Run){0, 0, 0};
}

static void describe_outputs(StrainLoad *handle) {
    const Estimator *e = handle->estimator;
    Record *record = &handle->record[SL_OUTPUTS];
    const size_t n_other = e->other_loads.present ? e->other_loads.map.n_loads : 0, n_flight = e->flight.present ? 1 : 0;
    OUTPUT_FIELDS(ADD_FIELD)
    add_field(record, "degrees_of_freedom", 1);
    add_field(record, "iterations", 1);
    add_field(record, "air_data", n_flight * N_AIR_DATA);
    add_field(record, "air_data_std", n_flight * N_AIR_DATA);
    add_field(record, "is_identified", n_flight * N_AIR_DATA);
    add_field(record, "air_data_used", n_flight * N_NAVIGATION);
    add_field(record, "is_linear", n_flight);
    add_field(record, "other_loads", n_other);
    add_field(record, "other_loads_std", n_other);
    add_field(record, "other_coefficients", n_other);
    add_field(record, "other_coefficients_std", n_other);
    add_field(record, "parameter_score", e->parameters.count);
    add_field(record, "usable", 1);
    add_field(record, "load_factor", e->thermal.map.vehicle_mass > 0.0 ? N_FORCES : 0);
}

static void describe_fit(StrainLoad *handle) {
    const size_t n = handle->estimator->map.n_gauges;
    Record *record = &handle->record[SL_FIT];
    FIT_FIELDS(ADD_FIELD)
    add_field(record, "standardised_residual", n);
    add_field(record, "valid", n);
    add_field(record, "is_suspect", n);
}

static void describe_tare(StrainLoad *handle) {
    Record *limits = &handle->record[SL_TARE_LIMITS], *outcome = &handle->record[SL_TARE];
    const size_t n = handle->steps.n_gauges;
    if (!handle->steps.present) {
        return;
    }
    for (size_t k = 0; k < N_TARE_LIMITS; k++) {
        add_field(limits, TARE_LIMIT_NAMES[k], 1);
    }
    add_field(limits, "known_strain", n);
    add_field(limits, "known_strain_std", n);
    add_field(outcome, "zero", n);
    add_field(outcome, "zero_std", n);
    add_field(outcome, "zero_common_std", 1);
    add_field(outcome, "reads", n);
    add_field(outcome, "scatter", n);
    add_field(outcome, "state", 1);
    add_field(outcome, "is_up", 1);
    add_field(outcome, "has_zeros", 1);
    for (size_t k = 0; k < N_TARE_VERDICT; k++) {
        add_field(outcome, TARE_VERDICT_NAMES[k], 1);
    }
}

int sl_version(void) {
    return SL_VERSION;
}

/* A handle in blocks of `memory`; NULL with a text. */
static StrainLoad *open_map(Memory *memory, const unsigned char *bytes, size_t length, char text[SL_TEXT_SIZE]) {
    const size_t copied = memory->taken;
    StrainLoad *handle = memory_take(memory, sizeof *handle);
    const Floating host = floating_enter();
    Estimator *e = handle != NULL && bytes != NULL ? estimator_create(memory, bytes, length, text) : NULL;
    floating_leave(&host);
    const int has_memory = e != NULL && tare_like(&e->tare, memory, &handle->whole) && tare_like(&e->tare, memory, &handle->steps);
    if (e == NULL ? handle == NULL || bytes == NULL : !has_memory) {
        snprintf(text, SL_TEXT_SIZE, "needs more memory than there is");
    }
    if (!has_memory) {
        memory_free(memory);
        return NULL;
    }
    handle->estimator = e;
    handle->model = &e->base;
    e->memory = *memory;
    handle->copied = copied;
    handle->model->mode = STEP;
    readings_note_given(&e->inputs, 0, e->map.n_gauges);
    describe_inputs(handle);
    describe_settings(handle);
    describe_outputs(handle);
    describe_fit(handle);
    describe_tare(handle);
    return handle;
}

StrainLoad *sl_open(const void *bytes, size_t length, char text[SL_TEXT_SIZE]) {
    Memory memory = {NULL, NULL, 0, 0};
    unsigned char *copy = memory_take(&memory, length);
    if (copy != NULL) {
        memcpy(copy, bytes, length);
    }
    return open_map(&memory, copy, length, text);
}

StrainLoad *sl_open_in(const void *bytes, size_t length, void *buffer, size_t size, char text[SL_TEXT_SIZE]) {
    Memory memory = memory_in(buffer, size);
    return open_map(&memory, bytes, length, text);
}

void sl_close(StrainLoad *handle) {
    if (handle != NULL) {
        const Memory memory = handle->estimator->memory;
        memory_free(&memory);
    }
}

size_t sl_size(const StrainLoad *handle, int record) {
    if (record == SL_ROWS) {
        return handle->estimator->map.n_gauges;
    }
    if (record == SL_STATE) {
        return sizeof(double) + model_state_size(handle->model);
    }
    if (record == SL_TARE_STATE) {
        return tare_state_size(&handle->steps);
    }
    if (record == SL_STACK) {
        return STACK_SIZE;
    }
    if (record == SL_MEMORY) {
        return handle->estimator->memory.taken - handle->copied + MEMORY_ALIGNMENT;
    }
    if (record == SL_ITERATIONS) {
        return handle->estimator->flight.present ? flight_most_iterations(&handle->estimator->flight) : 0;
    }
    return record >= 0 && record < N_RECORDS ? handle->record[record].size : 0;
}

int sl_field(const StrainLoad *handle, int record, size_t index, SlField *field) {
    if (record < 0 || record >= N_RECORDS || index >= handle->record[record].count) {
        return 0;
    }
    *field = handle->record[record].field[index];
    return 1;
}

/* The input of a place among the settings; SIZE_MAX beyond them. */
static size_t setting_input(const StrainLoad *handle, size_t place) {
    for (const Run *run = handle->setting; place < handle->record[SL_SETTINGS].size; run++) {
        if (place - run->first < run->count) {
            return run->input + (place - run->first);
        }
    }
    return SIZE_MAX;
}

int sl_set(StrainLoad *handle, size_t first, size_t count, const double *value, char text[SL_TEXT_SIZE]) {
    Estimator *e = handle->estimator;
    const Floating host = floating_enter();
    int good = 1;
    estimator_before_change(e); /* it may compute the outputs that a step left */
    for (size_t k = 0; good && k < count; k++) {
        const size_t input = setting_input(handle, first + k);
        good = input != SIZE_MAX && estimator_set_input(e, input, value[k], text);
        if (input == SIZE_MAX) {
            snprintf(text, SL_TEXT_SIZE, "there is no setting %lu", (unsigned long)(first + k));
        }
    }
    floating_leave(&host);
    return good;
}

void sl_get(const StrainLoad *handle, size_t first, size_t count, double *value) {
    for (size_t k = 0; k < count; k++) {
        const size_t input = setting_input(handle, first + k);
        value[k] = input == SIZE_MAX ? NAN : handle->estimator->inputs.value[input];
    }
}

void sl_restart(StrainLoad *handle) {
    estimator_restart(handle->estimator);
    model_set_time(handle->model, 0.0);
}

void sl_renew(StrainLoad *handle) {
    const Floating host = floating_enter();
    estimator_renew(handle->estimator);
    floating_leave(&host);
}

/* Take a sample in. */
static void set_sample(StrainLoad *handle, const double *input, const unsigned char *valid) {
    Estimator *e = handle->estimator;
    estimator_before_change(e);
    for (const Run *run = handle->sample; run < handle->sample + N_RUNS; run++) {
        memcpy(e->inputs.value + run->input, input + run->first, run->count * sizeof *input);
    }
    if (valid != NULL) {
        for (size_t i = 0; i < e->map.n_gauges; i++) {
            e->inputs.valid[i] = valid[i] != 0;
        }
    } else {
        memset(e->inputs.valid, 1, e->map.n_gauges);
    }
    e->outdated = 1;
}

static void write_flags(const unsigned char *flag, size_t count, double *output) {
    for (size_t k = 0; k < count; k++) {
        output[k] = (double)flag[k];
    }
}

/* Write the results of the sample; fit is NULL where it is not asked for. */
static void write_result(StrainLoad *handle, double *output, double *fit) {
    Estimator *e = handle->estimator;
    memcpy(output, estimator_outputs(e), N_OUTPUTS * sizeof *output);
    output += N_OUTPUTS;
    *output++ = degrees_of_freedom(e);
    *output++ = e->flight.present ? (double)e->flight.solver.iterations : 0.0;
    if (e->flight.present) {
        memcpy(output, e->flight.real, sizeof e->flight.real);
        write_flags(e->flight.flag, N_FLIGHT_FLAGS, output + N_FLIGHT_REALS);
        output += N_FLIGHT_REALS + N_FLIGHT_FLAGS;
    }
    if (e->other_loads.present) {
        const size_t count = N_OTHER_VALUES * e->other_loads.map.n_loads;
        memcpy(output, other_loads_of(e), count * sizeof *output);
        output += count;
    }
    for (size_t k = 0; k < e->parameters.count; k++) {
        output[k] = known_parameter_score(&e->inputs, k);
    }
    output += e->parameters.count;
    *output++ = (double)is_usable(e->output[HEALTH_STATE]);
    for (size_t i = 0; e->thermal.map.vehicle_mass > 0.0 && i < N_FORCES; i++) {
        output[i] = e->output[LOADS + i] / (e->thermal.map.vehicle_mass * STANDARD_GRAVITY);
    }
    if (fit != NULL) {
        write_fit(e, fit);
    }
}

void sl_step(StrainLoad *handle, double time, const double *input, const unsigned char *valid, double *output) {
    sl_series(handle, SL_TRACK, 0, 1, &time, input, valid, NULL, output);
}

/* Begin again, from a flight state or, with NULL, a search of the tables. */
static void begin(StrainLoad *handle, const double *state) {
    Track *base = &handle->estimator->flight.base;
    sl_restart(handle);
    if (handle->estimator->flight.present && state != NULL) {
        base->has_state = 1.0;
        memcpy(base->state, state, sizeof base->state);
    }
}

void sl_series(StrainLoad *handle, int how, int with_fit, size_t count, const double *time, const double *input,
               const unsigned char *valid, const double *start, double *output) {
    const size_t n_inputs = handle->record[SL_INPUTS].size, n_outputs = handle->record[SL_OUTPUTS].size;
    const size_t stride = n_outputs + (with_fit ? handle->record[SL_FIT].size : 0);
    char text[MODEL_TEXT_SIZE];
    const Floating host = floating_enter();
    for (size_t k = 0; k < count; k++) {
        const double given = time != NULL ? time[k] : 0.0;
        if (how == SL_EACH) {
            begin(handle, start != NULL ? start + k * N_STATES : NULL);
        }
        set_sample(handle, input + k * n_inputs, valid != NULL ? valid + k * handle->estimator->map.n_gauges : NULL);
        if (how == SL_TRACK) {
            const double now = isfinite(given) ? given : handle->model->time;
            model_step(handle->model, now, now, text);
        }
        double *result = output + k * stride;
        write_result(handle, result, with_fit ? result + n_outputs : NULL);
    }
    floating_leave(&host);
}

void sl_state(const StrainLoad *handle, unsigned char *bytes) {
    memcpy(bytes, &handle->model->time, sizeof(double));
    model_write_state(handle->model, bytes + sizeof(double));
}

int sl_restore(StrainLoad *handle, const unsigned char *bytes, char text[SL_TEXT_SIZE]) {
    const double time = double_at(bytes, 0);
    if (!isfinite(time)) {
        snprintf(text, SL_TEXT_SIZE, "holds a time that is no number");
        return 0;
    }
    if (!model_check_state(handle->model, bytes + sizeof time, text)) {
        return 0;
    }
    model_set_time(handle->model, time);
    model_read_state(handle->model, bytes + sizeof time);
    return 1;
}

void sl_tare(StrainLoad *handle, const double *limits, size_t count, const double *strain,
             const double *dynamic_pressure, double *outcome) {
    const Estimator *e = handle->estimator;
    Tare *tare = &handle->whole;
    if (tare->present) {
        const Floating host = floating_enter();
        use_limits(tare, &e->tare.limits, limits);
        tare_whole(tare, count, strain, dynamic_pressure);
        write_tare(tare, tare->judged, outcome);
        floating_leave(&host);
    }
}

int sl_tare_step(StrainLoad *handle, const double *limits, int is_up, const double *strain,
                 double dynamic_pressure, double *outcome) {
    const Estimator *e = handle->estimator;
    Tare *tare = &handle->steps;
    if (!tare->present) {
        return 0;
    }
    const Floating host = floating_enter();
    use_limits(tare, &e->tare.limits, limits);
    tare->up = is_up != 0;
    const int changed = tare_follow(tare);
    if (tare_is_averaging(tare)) {
        tare_set_reading(tare, strain);
        tare_take(tare, dynamic_pressure);
    }
    write_tare(tare, tare->zero, outcome);
    floating_leave(&host);
    return changed;
}

void sl_tare_drop(StrainLoad *handle, double *outcome) {
    if (handle->steps.present) {
        tare_drop(&handle->steps);
        write_tare(&handle->steps, handle->steps.zero, outcome);
    }
}

void sl_tare_state(const StrainLoad *handle, unsigned char *bytes) {
    tare_write_state(&handle->steps, bytes);
}

int sl_tare_restore(StrainLoad *handle, const unsigned char *bytes, double *outcome, char text[SL_TEXT_SIZE]) {
    if (!tare_state_fits(&handle->steps, bytes)) {
        snprintf(text, SL_TEXT_SIZE, "holds a tare that cannot be");
        return 0;
    }
    tare_read_state(&handle->steps, bytes);
    if (handle->steps.present) {
        write_tare(&handle->steps, handle->steps.zero, outcome);
    }
    return 1;
}
