/* The model behind the fronts for plant, autopilot and schedule: model.bin is checked as a whole, then variables, states
   and scratch lie in one block. Outputs are outdated by a time, an input or a step, and computed when they are read.

       model.bin   header | type, causality, start, minimum, maximum of each variable | data of the kind */

#include "system_model.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "../core/floating.h"
#include "../core/resource.h"

#define MAX_COUNT (1u << 24)
#define N_TABLES 5 /* type, causality, start, minimum, maximum of each variable */

static const char MAGIC[8] = "SFMUSYS";

static const Behaviour *behaviour_of(uint32_t kind) {
    static const Behaviour *const KINDS[] = {&PLANT, &AUTOPILOT, &SCHEDULE};
    return kind < sizeof KINDS / sizeof *KINDS ? KINDS[kind] : NULL;
}

/* Compare the header with the bytes that are there; the text states what is wrong. */
static int check_header(const unsigned char *bytes, size_t length, char *text) {
    if (!resource_check(bytes, length, MAGIC, SYSTEM_FORMAT_VERSION, "model", text)) {
        return 0;
    }
    const size_t variables = u32_at(bytes, 36), data = u32_at(bytes, 40);
    const int sizes = variables >= 1 && variables < MAX_COUNT && data < MAX_COUNT
                   && length == HEADER_SIZE + 8 * (N_TABLES * variables + data);
    if (!sizes || behaviour_of(u32_at(bytes, 32)) == NULL
        || memchr(bytes + 44, '\0', HEADER_SIZE - 44) == NULL) {
        snprintf(text, MODEL_TEXT_SIZE, "holds sizes that do not fit its length, or another kind of model");
        return 0;
    }
    return 1;
}

static void read_header(SystemModel *model, unsigned char *bytes) {
    model->bytes = bytes;
    model->behaviour = behaviour_of(u32_at(bytes, 32));
    model->n_variables = u32_at(bytes, 36);
    model->n_data = u32_at(bytes, 40);
    model->base = (Model){.guid = (const char *)bytes + 44,
                          .checksum = u32_at(bytes, CHECKSUM_AT),
                          .mode = INSTANTIATED,
                          .time_reference = (unsigned)model->n_variables};
    const double *next = (const double *)(const void *)(bytes + HEADER_SIZE);
    const double **tables[N_TABLES] = {&model->type, &model->causality, &model->start, &model->minimum,
                                       &model->maximum};
    for (int k = 0; k < N_TABLES; k++, next += model->n_variables) {
        *tables[k] = next;
    }
    model->data = next;
}

/* Whether a variable may hold a value. A real output or input may hold any: outside the envelope, or not a number, is
   a matter of the outputs. */
static int accepts(const SystemModel *model, size_t variable, double value) {
    const Causality causality = (Causality)model->causality[variable];
    if ((Type)model->type[variable] == REAL && (causality == OUTPUT || causality == INPUT)) {
        return 1;
    }
    return value >= model->minimum[variable] && value <= model->maximum[variable] && isfinite(value);
}

/* Types and causalities must be known ones, start values allowed, data finite. */
static int check_values(const SystemModel *model, char *text) {
    int good = 1;
    for (size_t i = 0; i < model->n_variables; i++) {
        good = good && model->type[i] >= (double)REAL && model->type[i] <= (double)BOOLEAN && model->causality[i] >= (double)OUTPUT
            && model->causality[i] <= (double)TUNABLE_PARAMETER && isfinite(model->start[i])
            && (model->type[i] == (double)REAL || (model->minimum[i] >= INT32_MIN && model->maximum[i] <= INT32_MAX))
            && accepts(model, i, model->start[i]);
    }
    for (size_t i = 0; i < model->n_data; i++) {
        good = good && isfinite(model->data[i]);
    }
    if (!good) {
        snprintf(text, MODEL_TEXT_SIZE, "holds a value that is not allowed");
    }
    return good;
}

void model_destroy(Model *base) {
    SystemModel *model = (SystemModel *)base;
    free(model->bytes);
    free(model->memory);
    free(model);
}

static void reset(Model *base) {
    SystemModel *model = (SystemModel *)base;
    memcpy(model->value, model->start, model->n_variables * sizeof *model->value);
    memset(model->state, 0, model->n_states * sizeof *model->state);
    model->outdated = 1;
}

static Model *create(unsigned char *bytes, size_t length, char text[MODEL_TEXT_SIZE]) {
    SystemModel *model = check_header(bytes, length, text) ? calloc(1, sizeof *model) : NULL;
    if (model == NULL) {
        free(bytes);
        return NULL;
    }
    read_header(model, bytes);
    int good = check_values(model, text) && model->behaviour->prepare(model, text) == STATUS_OK;
    if (good) {
        model->memory = calloc(model->n_variables + model->n_states + model->n_work, sizeof *model->memory);
        if (model->memory == NULL) {
            snprintf(text, MODEL_TEXT_SIZE, "needs more memory than there is");
            good = 0;
        }
    }
    if (!good) {
        model_destroy(&model->base);
        return NULL;
    }
    model->value = model->memory;
    model->state = model->value + model->n_variables;
    model->work = model->state + model->n_states;
    reset(&model->base);
    return &model->base;
}

static int is_before_steps(const SystemModel *model) {
    return ((int)model->base.mode & BEFORE_STEPS) != 0;
}

/* Compute the outputs if something has changed. */
static void system_update(SystemModel *model) {
    if (!model->outdated) {
        return;
    }
    if (is_before_steps(model) && model->behaviour->begin != NULL) {
        model->behaviour->begin(model);
    }
    if (model->behaviour->outputs != NULL) {
        model->behaviour->outputs(model);
    }
    model->outdated = 0;
}

void model_set_time(Model *base, double time) {
    base->time = time;
    ((SystemModel *)base)->outdated = 1;
}

/* The last time that states begin from the start values. */
static void end_initialization(Model *base) {
    SystemModel *model = (SystemModel *)base;
    model->outdated = 1;
    system_update(model);
}

static int step(Model *base, double start, double end, char text[MODEL_TEXT_SIZE]) {
    SystemModel *model = (SystemModel *)base;
    system_update(model);
    base->time = start;
    const int status = model->behaviour->step(model, end, text);
    model->outdated = 1;
    return status;
}

/* Variables. */

Type model_type_of(const Model *base, size_t variable) {
    const SystemModel *model = (const SystemModel *)base;
    return variable < model->n_variables ? (Type)model->type[variable] : NO_VARIABLE;
}

/* Every variable is an array of one element. */
Selection model_array(const Model *base, unsigned reference) {
    return (Selection){NULL, reference, reference < ((const SystemModel *)base)->n_variables};
}

/* Whether all variables are of a type; if not, text names one that is not. */
static int are(const SystemModel *model, const Selection *which, Type type, char *text) {
    for (size_t k = 0; k < which->count; k++) {
        if (!is_read_as(model_type_of(&model->base, selected(which, k)), type)) {
            snprintf(text, MODEL_TEXT_SIZE, WRONG_TYPE, (unsigned long)selected(which, k));
            return 0;
        }
    }
    return 1;
}

static int get(Model *base, Type type, const Selection *which, void *value, char text[MODEL_TEXT_SIZE]) {
    SystemModel *model = (SystemModel *)base;
    if (!are(model, which, type, text)) {
        return 0;
    }
    system_update(model);
    for (size_t k = 0; k < which->count; k++) {
        put_value(type, value, k, model->value[selected(which, k)]);
    }
    return 1;
}

static int set_variable(SystemModel *model, size_t variable, double value, char *text) {
    const Causality causality = (Causality)model->causality[variable];
    if (causality == OUTPUT || (causality == FIXED_PARAMETER && !is_before_steps(model))) {
        snprintf(text, MODEL_TEXT_SIZE, "variable %lu %s", (unsigned long)variable,
                 causality == OUTPUT ? "is an output" : "is fixed: it cannot be set after initialization");
        return 0;
    }
    if (!accepts(model, variable, value)) {
        snprintf(text, MODEL_TEXT_SIZE, "variable %lu: %g found, must be from %g to %g", (unsigned long)variable,
                 value, model->minimum[variable], model->maximum[variable]);
        return 0;
    }
    model->value[variable] = value;
    model->outdated = 1;
    return 1;
}

static int set(Model *base, Type type, const Selection *which, const void *value, char text[MODEL_TEXT_SIZE]) {
    SystemModel *model = (SystemModel *)base;
    int good = are(model, which, type, text);
    for (size_t k = 0; k < which->count && good; k++) {
        const double given = value_at(type, value, k);
        good = set_variable(model, selected(which, k), type == BOOLEAN ? given != 0.0 : given, text);
    }
    return good;
}

/* State: variables and states as float64, which lie behind each other in memory. */

size_t model_state_size(const Model *base) {
    const SystemModel *model = (const SystemModel *)base;
    return sizeof(double) * (model->n_variables + model->n_states);
}

void model_write_state(const Model *base, unsigned char *bytes) {
    memcpy(bytes, ((const SystemModel *)base)->value, model_state_size(base));
}

int model_check_state(const Model *base, const unsigned char *bytes, char text[MODEL_TEXT_SIZE]) {
    const SystemModel *model = (const SystemModel *)base;
    const Floating host = floating_enter();
    size_t i = 0;
    while (i < model->n_variables && accepts(model, i, double_at(bytes, i))) {
        i++;
    }
    floating_leave(&host);
    if (i < model->n_variables) {
        snprintf(text, MODEL_TEXT_SIZE, "holds %g for variable %lu, which is not allowed", double_at(bytes, i), (unsigned long)i);
    }
    return i == model->n_variables;
}

void model_read_state(Model *base, const unsigned char *bytes) {
    SystemModel *model = (SystemModel *)base;
    memcpy(model->value, bytes, model_state_size(base));
    model->outdated = 1;
}

const ModelFacts MODEL = {
    .resource = "model.bin",
    .content = "model",
    .foreign_state = "is that of another FMU, or of another version of it",
    /* Nothing happens that the outputs do not show. */
    .create = create,
    .reset = reset,
    .end_initialization = end_initialization,
    .step = step,
    .get = get,
    .set = set,
};
