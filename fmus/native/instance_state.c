#include "instance_state.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define STATE_VERSION 1u
#define STATE_MARK 0x53464D45u
#define CHECKED_FROM 16 /* the checksum is over all bytes from here on */

static const char MAGIC[8] = "SFMUSTA";
static const char ANOTHER_MAP[] = "is that of an FMU with another map";

/* Some importers hand the state itself, not its address, to fmi2FreeFMUstate: what that then takes for the state is
   the first word, and freeing NULL does no harm. One library serves every map, so the head says how many bytes follow
   and of which map they are: nothing behind it is read or written before both fit the instance. */
typedef struct {
    void *always_null;
    uint32_t mark, map_checksum;
    uint64_t size;
} StateHead;

/* Serialised: this header, time and inputs as float64, a byte per gauge for valid. */
typedef struct {
    char magic[8];
    uint32_t version, checksum;
    uint32_t map_checksum, n_gauges, mode, kind;
} SerialHeader;

static size_t n_doubles(const Instance *instance) {
    return 1 + instance->estimator->map.n_gauges + N_SCALAR_INPUTS;
}

size_t state_size(const Instance *instance) {
    return sizeof(SerialHeader) + 8 * n_doubles(instance) + instance->estimator->map.n_gauges;
}

static void write_state(const Instance *instance, unsigned char *bytes) {
    const Estimator *e = instance->estimator;
    SerialHeader header = {
        .version = STATE_VERSION,
        .map_checksum = e->map.checksum,
        .n_gauges = (uint32_t)e->map.n_gauges,
        .mode = (uint32_t)instance->mode,
        .kind = (uint32_t)instance->kind,
    };
    memcpy(header.magic, MAGIC, sizeof MAGIC);
    unsigned char *next = bytes + sizeof header;
    memcpy(next, &instance->time, sizeof instance->time);
    next += sizeof instance->time;
    memcpy(next, e->input, 8 * (n_doubles(instance) - 1));
    next += 8 * (n_doubles(instance) - 1);
    memcpy(next, e->valid, e->map.n_gauges);
    memcpy(bytes, &header, sizeof header);
    header.checksum = crc32(bytes + CHECKED_FROM, state_size(instance) - CHECKED_FROM);
    memcpy(bytes, &header, sizeof header);
}

static int mode_exists(uint32_t mode) {
    return mode > 0 && mode <= CONFIGURATION && (mode & (mode - 1)) == 0;
}

/* What is wrong with time and inputs of a serialised state; NULL if nothing is. */
static const char *value_fault(const Instance *instance, const unsigned char *bytes) {
    const Estimator *e = instance->estimator;
    const unsigned char *next = bytes + sizeof(SerialHeader);
    char text[MAP_TEXT_SIZE];
    double value;
    memcpy(&value, next, sizeof value);
    if (!isfinite(value)) {
        return "holds a time that is not finite";
    }
    for (size_t place = 0; place + 1 < n_doubles(instance); place++) {
        memcpy(&value, next + 8 * (place + 1), sizeof value);
        if (!estimator_accepts(e, place, value, text)) {
            return "holds a setting that is not allowed";
        }
    }
    next += 8 * n_doubles(instance);
    for (size_t i = 0; i < e->map.n_gauges; i++) {
        if (next[i] > 1) {
            return "holds a gauge that is neither valid nor not";
        }
    }
    return NULL;
}

/* What is wrong with a serialised state of the given size; NULL if nothing is. */
static const char *state_fault(const Instance *instance, const unsigned char *bytes, size_t size) {
    const Map *map = &instance->estimator->map;
    SerialHeader header;
    if (size < sizeof header || memcmp(bytes, MAGIC, sizeof MAGIC) != 0) {
        return "is no state of such an FMU";
    }
    memcpy(&header, bytes, sizeof header);
    if (header.version != STATE_VERSION) {
        return "has another format version";
    }
    /* The checksum first: of an undamaged state the wrong length is not what is to be told, but the wrong map. */
    const int damaged = header.checksum != crc32(bytes + CHECKED_FROM, size - CHECKED_FROM);
    if (!damaged && (header.map_checksum != map->checksum || header.n_gauges != map->n_gauges)) {
        return ANOTHER_MAP;
    }
    if (size != state_size(instance)) {
        return "has the wrong length";
    }
    if (damaged) {
        return "is damaged: its checksum is wrong";
    }
    if (header.kind != (uint32_t)instance->kind || !mode_exists(header.mode)) {
        return "is that of another kind of instance";
    }
    return value_fault(instance, bytes);
}

static void read_state(Instance *instance, const unsigned char *bytes) {
    Estimator *e = instance->estimator;
    SerialHeader header;
    memcpy(&header, bytes, sizeof header);
    instance->mode = (Mode)header.mode;
    const unsigned char *next = bytes + sizeof header;
    memcpy(&instance->time, next, sizeof instance->time);
    next += sizeof instance->time;
    memcpy(e->input, next, 8 * (n_doubles(instance) - 1));
    next += 8 * (n_doubles(instance) - 1);
    memcpy(e->valid, next, e->map.n_gauges);
    e->outdated = 1;
}

/* The serialised state within an FMU state of the instance's map, state_size long; NULL, after a message, if it is
   none. */
static unsigned char *serialised(const Instance *instance, const void *state) {
    const StateHead *head = state;
    if (head == NULL || head->mark != STATE_MARK) {
        instance_error(instance, "the FMU state is none of this FMU");
        return NULL;
    }
    if (head->map_checksum != instance->estimator->map.checksum || head->size != state_size(instance)) {
        instance_error(instance, "the FMU state %s", ANOTHER_MAP);
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
    head->map_checksum = instance->estimator->map.checksum;
    head->size = state_size(instance);
    return head;
}

int state_get(Instance *instance, void **state) {
    if (*state == NULL) {
        *state = new_state(instance);
    }
    unsigned char *bytes = *state != NULL ? serialised(instance, *state) : NULL;
    if (bytes == NULL) {
        return STATUS_ERROR;
    }
    write_state(instance, bytes);
    return STATUS_OK;
}

int state_set(Instance *instance, const void *state) {
    const unsigned char *bytes = serialised(instance, state);
    if (bytes == NULL) {
        return STATUS_ERROR;
    }
    const char *fault = state_fault(instance, bytes, state_size(instance));
    if (fault != NULL) {
        return instance_error(instance, "the FMU state %s", fault);
    }
    read_state(instance, bytes);
    return STATUS_OK;
}

void state_free(void **state) {
    if (state != NULL && *state != NULL) {
        free(*state);
        *state = NULL;
    }
}

int state_serialized_size(const Instance *instance, const void *state, size_t *size) {
    if (serialised(instance, state) == NULL) {
        return STATUS_ERROR;
    }
    *size = state_size(instance);
    return STATUS_OK;
}

int state_serialize(Instance *instance, const void *state, void *bytes, size_t size) {
    const unsigned char *content = serialised(instance, state);
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

int state_deserialize(Instance *instance, const void *bytes, size_t size, void **state) {
    const char *fault = state_fault(instance, bytes, size);
    if (fault != NULL) {
        return instance_error(instance, "the serialised state %s", fault);
    }
    if (*state == NULL) {
        *state = new_state(instance);
    }
    unsigned char *content = *state != NULL ? serialised(instance, *state) : NULL;
    if (content == NULL) {
        return STATUS_ERROR;
    }
    memcpy(content, bytes, size);
    return STATUS_OK;
}
