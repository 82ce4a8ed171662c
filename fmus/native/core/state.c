/* FMU states: in memory, and serialised as bytes that may come from anywhere.

       in memory    head: NULL | mark | checksum of the resource | size, then the serialised state
       serialised   header: magic | version | CRC-32 | checksum of the resource | size, mode, kind, then time, model's part

   Both pass the same checks before anything is read: size, checksum, resource, kind of instance, a time that is a
   number, and the model's own part (model_check_state). An instance changes only after all of them.
   docs/developers/native.md, "States, derivatives, messages". */

#include "state.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "resource.h"

#define STATE_VERSION 7u
#define STATE_MARK 0x53464D45u
#define CHECKED_FROM 16 /* the checksum is over all bytes from here on */

static const char MAGIC[8] = "SFMUSTA";

/* Some importers pass the state itself, not its address, to fmi2FreeFMUstate: what that then takes for the state is
   the first word, and freeing NULL does no harm. One library serves every resource, so the head holds how many bytes
   follow and of which resource they are: nothing behind it is read or written before both fit the instance. */
typedef struct {
    void *always_null;
    uint32_t mark, resource_checksum;
    uint64_t size;
} StateHead;

/* Serialised: this header, time as float64, the model's part. */
typedef struct {
    char magic[8];
    uint32_t version, checksum;
    uint32_t resource_checksum, model_size, mode, kind;
} SerialHeader;

static size_t model_size(const Instance *instance) {
    return model_state_size(instance->model);
}

/* The state of the node of ports lies behind the model's. */
static size_t node_size(const Instance *instance) {
    return instance->node != NULL ? instance->node->size : 0;
}

size_t state_size(const Instance *instance) {
    return sizeof(SerialHeader) + sizeof(double) + model_size(instance) + node_size(instance);
}

static void write_state(const Instance *instance, unsigned char *bytes) {
    const Model *model = instance->model;
    SerialHeader header = {
        .version = STATE_VERSION,
        .resource_checksum = model->checksum,
        .model_size = (uint32_t)model_size(instance),
        .mode = (uint32_t)model->mode,
        .kind = (uint32_t)instance->kind,
    };
    memcpy(header.magic, MAGIC, sizeof MAGIC);
    memcpy(bytes + sizeof header, &model->time, sizeof model->time);
    model_write_state(model, bytes + sizeof header + sizeof model->time);
    if (instance->node != NULL) {
        memcpy(bytes + state_size(instance) - node_size(instance), instance->node->state, node_size(instance));
    }
    memcpy(bytes, &header, sizeof header);
    header.checksum = crc32(bytes + CHECKED_FROM, state_size(instance) - CHECKED_FROM);
    memcpy(bytes, &header, sizeof header);
}

/* What is wrong with a serialised state of the given size; NULL if nothing is. It may be written to text. */
static const char *state_fault(const Instance *instance, const unsigned char *bytes, size_t size,
                               char text[MODEL_TEXT_SIZE]) {
    const Model *model = instance->model;
    SerialHeader header;
    if (size < sizeof header || memcmp(bytes, MAGIC, sizeof MAGIC) != 0) {
        return "is no state of such an FMU";
    }
    memcpy(&header, bytes, sizeof header);
    if (header.version != STATE_VERSION) {
        return "has another format version";
    }
    /* The checksum first: of an undamaged state the other resource is reported, not the length that follows from it. */
    const int damaged = header.checksum != crc32(bytes + CHECKED_FROM, size - CHECKED_FROM);
    if (!damaged && (header.resource_checksum != model->checksum || header.model_size != model_size(instance))) {
        return MODEL.foreign_state;
    }
    if (size != state_size(instance)) {
        snprintf(text, MODEL_TEXT_SIZE, "takes %lu bytes, %lu found", (unsigned long)state_size(instance),
                 (unsigned long)size);
        return text;
    }
    if (damaged) {
        return "is damaged: its checksum is wrong";
    }
    const int is_mode = header.mode > 0 && header.mode <= CONFIGURATION && (header.mode & (header.mode - 1)) == 0;
    if (header.kind != (uint32_t)instance->kind || !is_mode) {
        return "is that of another kind of instance";
    }
    if (!isfinite(double_at(bytes + sizeof header, 0))) {
        return "holds a time that is not finite";
    }
    if (!model_check_state(model, bytes + sizeof header + sizeof(double), text)) {
        return text;
    }
    const unsigned char *of_node = bytes + size - node_size(instance);
    return instance->node == NULL || node_check_state(instance->node, of_node, text) ? NULL : text;
}

static void read_state(Instance *instance, const unsigned char *bytes) {
    Model *model = instance->model;
    SerialHeader header;
    memcpy(&header, bytes, sizeof header);
    model->mode = (Mode)header.mode;
    model->time = double_at(bytes + sizeof header, 0);
    model_read_state(model, bytes + sizeof header + sizeof model->time);
    if (instance->node != NULL) {
        memcpy(instance->node->state, bytes + state_size(instance) - node_size(instance), node_size(instance));
    }
    instance_forget_ticks(instance);
    instance->ending = 0;
}

/* The serialised state within an FMU state of the instance's resource, state_size long; NULL, after a message, if it is
   none. */
static unsigned char *serialised(const Instance *instance, const void *state) {
    const StateHead *head = state;
    if (head == NULL || head->mark != STATE_MARK) {
        instance_error(instance, "the FMU state is none of this FMU");
        return NULL;
    }
    if (head->resource_checksum != instance->model->checksum || head->size != state_size(instance)) {
        instance_error(instance, "the FMU state %s", MODEL.foreign_state);
        return NULL;
    }
    return (unsigned char *)(uintptr_t)(head + 1);
}

static void *new_state(const Instance *instance) {
    StateHead *head = calloc(1, sizeof *head + state_size(instance));
    if (head == NULL) {
        instance_error(instance, "the FMU state needs more memory than there is");
        return NULL;
    }
    head->mark = STATE_MARK;
    head->resource_checksum = instance->model->checksum;
    head->size = state_size(instance);
    return head;
}

/* Whether instance and arguments of a function are there. */
static int are_given(const Instance *instance, const char *function, const void *first, const void *second) {
    return instance != NULL && instance_given(instance, function, first) && instance_given(instance, function, second);
}

/* The place for a serialised state in an FMU state, which is made where there is none yet; NULL after a message. */
static unsigned char *place_in(const Instance *instance, void **state) {
    if (*state == NULL) {
        *state = new_state(instance);
    }
    return *state != NULL ? serialised(instance, *state) : NULL;
}

int state_get(Instance *instance, const char *function, void **state) {
    unsigned char *bytes = are_given(instance, function, state, state) ? place_in(instance, state) : NULL;
    if (bytes == NULL) {
        return STATUS_ERROR;
    }
    write_state(instance, bytes);
    return STATUS_OK;
}

int state_set(Instance *instance, const void *state) {
    char text[MODEL_TEXT_SIZE];
    const unsigned char *bytes = instance != NULL ? serialised(instance, state) : NULL;
    if (bytes == NULL) {
        return STATUS_ERROR;
    }
    const char *fault = state_fault(instance, bytes, state_size(instance), text);
    if (fault != NULL) {
        return instance_error(instance, "the FMU state %s", fault);
    }
    read_state(instance, bytes);
    return STATUS_OK;
}

int state_free(const Instance *instance, void **state) {
    if (instance != NULL && state != NULL) {
        free(*state);
        *state = NULL;
    }
    return instance != NULL ? STATUS_OK : STATUS_ERROR;
}

int state_serialized_size(const Instance *instance, const char *function, const void *state, size_t *size) {
    if (!are_given(instance, function, state, size) || serialised(instance, state) == NULL) {
        return STATUS_ERROR;
    }
    *size = state_size(instance);
    return STATUS_OK;
}

int state_serialize(Instance *instance, const char *function, const void *state, void *bytes, size_t size) {
    const unsigned char *content = are_given(instance, function, bytes, bytes) ? serialised(instance, state) : NULL;
    if (content == NULL) {
        return STATUS_ERROR;
    }
    if (size < state_size(instance)) {
        return instance_error(instance, "a serialised state takes %lu bytes, %lu found",
                              (unsigned long)state_size(instance), (unsigned long)size);
    }
    memcpy(bytes, content, state_size(instance));
    return STATUS_OK;
}

int state_deserialize(Instance *instance, const char *function, const void *bytes, size_t size, void **state) {
    char text[MODEL_TEXT_SIZE];
    if (!are_given(instance, function, bytes, state)) {
        return STATUS_ERROR;
    }
    const char *fault = state_fault(instance, bytes, size, text);
    if (fault != NULL) {
        return instance_error(instance, "the serialised state %s", fault);
    }
    unsigned char *content = place_in(instance, state);
    if (content == NULL) {
        return STATUS_ERROR;
    }
    memcpy(content, bytes, size);
    return STATUS_OK;
}
