#include "model.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "map_resource.h"

#define LARGEST_COUNT (1u << 24)
#define N_TABLES 5 /* type, causality, start, minimum, maximum of each variable */

#define STATE_VERSION 1u
#define STATE_CHECKED_FROM 16

static const char MAGIC[8] = "SFMUSYS";
static const char STATE_MAGIC[8] = "SFMUSYT";

/* Serialised: this header, then time, variables and states as float64. */
typedef struct {
    char magic[8];
    uint32_t version, checksum;
    uint32_t model_checksum, mode;
} StateHeader;

static const Behaviour *behaviour_of(uint32_t kind) {
    static const Behaviour *const KINDS[] = {&PLANT, &AUTOPILOT, &SCHEDULE};
    return kind < sizeof KINDS / sizeof *KINDS ? KINDS[kind] : NULL;
}

/* Check what the header says against the bytes that are there; the text says what is wrong. */
static int check_header(const unsigned char *bytes, size_t length, char *text) {
    if (!resource_check(bytes, length, MAGIC, MODEL_FORMAT_VERSION, "model", text)) {
        return 0;
    }
    const size_t variables = u32_at(bytes, 36), data = u32_at(bytes, 40);
    const int sizes = variables >= 1 && variables < LARGEST_COUNT && data < LARGEST_COUNT
                   && length == HEADER_SIZE + 8 * (N_TABLES * variables + data);
    if (!sizes || behaviour_of(u32_at(bytes, 32)) == NULL
        || memchr(bytes + 44, '\0', HEADER_SIZE - 44) == NULL) {
        snprintf(text, MODEL_TEXT_SIZE, "holds sizes that do not fit its length, or another kind of model");
        return 0;
    }
    return 1;
}

static void read_header(Model *model, unsigned char *bytes) {
    model->bytes = bytes;
    model->behaviour = behaviour_of(u32_at(bytes, 32));
    model->checksum = u32_at(bytes, 24);
    model->guid = (const char *)bytes + 44;
    model->n_variables = u32_at(bytes, 36);
    model->n_data = u32_at(bytes, 40);
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
static int accepts(const Model *model, size_t variable, double value) {
    const Causality causality = (Causality)model->causality[variable];
    if ((Type)model->type[variable] == REAL && (causality == OUTPUT || causality == INPUT)) {
        return 1;
    }
    return value >= model->minimum[variable] && value <= model->maximum[variable] && isfinite(value);
}

/* Types and causalities must be known ones, start values allowed, data finite. */
static int check_values(const Model *model, char *text) {
    int good = 1;
    for (size_t i = 0; i < model->n_variables; i++) {
        good = good && model->type[i] >= REAL && model->type[i] <= BOOLEAN && model->causality[i] >= OUTPUT
            && model->causality[i] <= TUNABLE_PARAMETER && isfinite(model->start[i])
            && (model->type[i] == REAL || (model->minimum[i] >= INT32_MIN && model->maximum[i] <= INT32_MAX))
            && accepts(model, i, model->start[i]);
    }
    for (size_t i = 0; i < model->n_data; i++) {
        good = good && isfinite(model->data[i]);
    }
    if (!good) {
        snprintf(text, MODEL_TEXT_SIZE, "holds a value that cannot be");
    }
    return good;
}

Model *model_create(unsigned char *bytes, size_t length, char text[MODEL_TEXT_SIZE]) {
    Model *model = check_header(bytes, length, text) ? calloc(1, sizeof *model) : NULL;
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
        model_free(model);
        return NULL;
    }
    model->value = model->memory;
    model->state = model->value + model->n_variables;
    model->work = model->state + model->n_states;
    model_reset(model);
    return model;
}

void model_free(Model *model) {
    if (model != NULL) {
        free(model->bytes);
        free(model->memory);
        free(model);
    }
}

void model_reset(Model *model) {
    memcpy(model->value, model->start, model->n_variables * sizeof *model->value);
    memset(model->state, 0, model->n_states * sizeof *model->state);
    model->mode = INSTANTIATED;
    model->time = 0.0;
    model->outdated = 1;
}

void model_update(Model *model) {
    if (!model->outdated) {
        return;
    }
    if (model->mode & (INSTANTIATED | INITIALIZATION)) {
        model->behaviour->begin(model);
    }
    model->behaviour->outputs(model);
    model->outdated = 0;
}

int model_has(const Model *model, size_t variable, Type type) {
    return variable < model->n_variables && (Type)model->type[variable] == type;
}

int model_set(Model *model, size_t variable, double value, char text[MODEL_TEXT_SIZE]) {
    const Causality causality = (Causality)model->causality[variable];
    const int early = (model->mode & (INSTANTIATED | INITIALIZATION)) != 0;
    if (causality == OUTPUT || (causality == FIXED_PARAMETER && !early)) {
        snprintf(text, MODEL_TEXT_SIZE, "variable %lu %s", (unsigned long)variable,
                 causality == OUTPUT ? "is an output" : "is fixed: it cannot be set after initialization");
        return STATUS_ERROR;
    }
    if (!accepts(model, variable, value)) {
        snprintf(text, MODEL_TEXT_SIZE, "variable %lu: %g found, must be from %g to %g", (unsigned long)variable,
                 value, model->minimum[variable], model->maximum[variable]);
        return STATUS_ERROR;
    }
    model->value[variable] = value;
    model->outdated = 1;
    return STATUS_OK;
}

static size_t n_doubles(const Model *model) {
    return 1 + model->n_variables + model->n_states;
}

size_t model_state_size(const Model *model) {
    return sizeof(StateHeader) + 8 * n_doubles(model);
}

void model_write_state(const Model *model, unsigned char *bytes) {
    StateHeader header = {
        .version = STATE_VERSION, .model_checksum = model->checksum, .mode = (uint32_t)model->mode};
    memcpy(header.magic, STATE_MAGIC, sizeof STATE_MAGIC);
    memcpy(bytes + sizeof header, &model->time, sizeof model->time);
    memcpy(bytes + sizeof header + sizeof model->time, model->value, 8 * (n_doubles(model) - 1));
    memcpy(bytes, &header, sizeof header);
    header.checksum = crc32(bytes + STATE_CHECKED_FROM, model_state_size(model) - STATE_CHECKED_FROM);
    memcpy(bytes, &header, sizeof header);
}

int model_check_state(const Model *model, const unsigned char *bytes, size_t size, char text[MODEL_TEXT_SIZE]) {
    StateHeader header;
    if (size < sizeof header || memcmp(bytes, STATE_MAGIC, sizeof STATE_MAGIC) != 0) {
        snprintf(text, MODEL_TEXT_SIZE, "is no state of such an FMU");
        return STATUS_ERROR;
    }
    memcpy(&header, bytes, sizeof header);
    /* The checksum first: of an undamaged state the wrong length is not what is to be told, but the wrong model. */
    const int damaged = header.checksum != crc32(bytes + STATE_CHECKED_FROM, size - STATE_CHECKED_FROM);
    if (header.version != STATE_VERSION || (!damaged && header.model_checksum != model->checksum)) {
        snprintf(text, MODEL_TEXT_SIZE, STATE_OF_ANOTHER_MODEL);
        return STATUS_ERROR;
    }
    if (size != model_state_size(model)) {
        snprintf(text, MODEL_TEXT_SIZE, "takes %lu bytes, %lu found", (unsigned long)model_state_size(model),
                 (unsigned long)size);
        return STATUS_ERROR;
    }
    const int mode_exists = header.mode == INSTANTIATED || header.mode == INITIALIZATION || header.mode == STEP
                         || header.mode == TERMINATED;
    if (damaged || !mode_exists) {
        snprintf(text, MODEL_TEXT_SIZE, "is damaged: its checksum is wrong");
        return STATUS_ERROR;
    }
    for (size_t i = 0; i < model->n_variables; i++) {
        double value;
        memcpy(&value, bytes + sizeof header + 8 * (1 + i), sizeof value);
        if (!accepts(model, i, value)) {
            snprintf(text, MODEL_TEXT_SIZE, "holds %g for variable %lu, which cannot be", value, (unsigned long)i);
            return STATUS_ERROR;
        }
    }
    return STATUS_OK;
}

void model_read_state(Model *model, const unsigned char *bytes) {
    StateHeader header;
    memcpy(&header, bytes, sizeof header);
    model->mode = (Mode)header.mode;
    memcpy(&model->time, bytes + sizeof header, sizeof model->time);
    memcpy(model->value, bytes + sizeof header + sizeof model->time, 8 * (n_doubles(model) - 1));
    model->outdated = 1;
}
