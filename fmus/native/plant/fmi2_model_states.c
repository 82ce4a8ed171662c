/* The functions of FMI 2.0.5 for FMU states: a copy of the model's serialised state is one. */

#include "fmi2_model.h"

#include <stdlib.h>
#include <string.h>

#define STATE_MARK 0x53464D50u

/* Some importers hand the state itself, not its address, to fmi2FreeFMUstate: what that then takes for the state is
   the first word, and freeing NULL does no harm. One library serves every model, so the head says how many bytes of a
   serialised state follow and of which model they are: nothing behind it is touched before both fit the instance. */
typedef struct {
    void *always_null;
    uint32_t mark, model_checksum;
    uint64_t size;
} StateHead;

/* The serialised state within an FMU state of the instance's model; NULL, after a message, if it is none. */
static unsigned char *serialised(const Instance *s, fmi2FMUstate state) {
    StateHead *head = state;
    if (head == NULL || head->mark != STATE_MARK) {
        fmi2_tell(s, fmi2Error, "the FMU state is none of this FMU");
        return NULL;
    }
    if (head->model_checksum != s->model->checksum || head->size != model_state_size(s->model)) {
        fmi2_tell(s, fmi2Error, "the FMU state " STATE_OF_ANOTHER_MODEL);
        return NULL;
    }
    return (unsigned char *)(head + 1);
}

/* The serialised state within *state, which is made if it is NULL; NULL after a message. */
static unsigned char *place_of(const Instance *s, fmi2FMUstate *state) {
    if (*state == NULL) {
        StateHead *head = calloc(1, sizeof *head + model_state_size(s->model));
        if (head == NULL) {
            fmi2_tell(s, fmi2Error, "the FMU state needs more memory than there is");
            return NULL;
        }
        head->mark = STATE_MARK;
        head->model_checksum = s->model->checksum;
        head->size = model_state_size(s->model);
        *state = head;
    }
    return serialised(s, *state);
}

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *state) {
    Instance *s = c;
    unsigned char *bytes = fmi2_allowed(s, "fmi2GetFMUstate", READABLE, 1, state, state) ? place_of(s, state) : NULL;
    if (bytes == NULL) {
        return fmi2Error;
    }
    model_write_state(s->model, bytes);
    return fmi2OK;
}

static fmi2Status check_state(Instance *s, const unsigned char *bytes, size_t size) {
    char text[MODEL_TEXT_SIZE];
    if (model_check_state(s->model, bytes, size, text) != STATUS_OK) {
        return fmi2_tell(s, fmi2Error, "the FMU state %s", text);
    }
    return fmi2OK;
}

fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state) {
    Instance *s = c;
    const unsigned char *bytes = s != NULL ? serialised(s, state) : NULL;
    if (bytes == NULL || check_state(s, bytes, model_state_size(s->model)) != fmi2OK) {
        return fmi2Error;
    }
    model_read_state(s->model, bytes);
    s->terminated = 0;
    return fmi2OK;
}

fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *state) {
    if (c == NULL) {
        return fmi2Error;
    }
    if (state != NULL) {
        free(*state);
        *state = NULL;
    }
    return fmi2OK;
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate state, size_t *size) {
    Instance *s = c;
    if (!fmi2_allowed(s, "fmi2SerializedFMUstateSize", READABLE, 1, state, size) || serialised(s, state) == NULL) {
        return fmi2Error;
    }
    *size = model_state_size(s->model);
    return fmi2OK;
}

fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate state, fmi2Byte bytes[], size_t size) {
    Instance *s = c;
    const unsigned char *content = fmi2_allowed(s, "fmi2SerializeFMUstate", READABLE, 1, state, bytes)
                                 ? serialised(s, state) : NULL;
    if (content == NULL) {
        return fmi2Error;
    }
    if (size < model_state_size(s->model)) {
        return fmi2_tell(s, fmi2Error, "a serialised state takes %lu bytes, %lu found",
                    (unsigned long)model_state_size(s->model), (unsigned long)size);
    }
    memcpy(bytes, content, model_state_size(s->model));
    return fmi2OK;
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state) {
    Instance *s = c;
    if (!fmi2_allowed(s, "fmi2DeSerializeFMUstate", READABLE, 1, bytes, state)
        || check_state(s, (const unsigned char *)bytes, size) != fmi2OK) {
        return fmi2Error;
    }
    unsigned char *content = place_of(s, state);
    if (content == NULL) {
        return fmi2Error;
    }
    memcpy(content, bytes, size);
    return fmi2OK;
}
