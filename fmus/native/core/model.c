/* The functions of a model that compute, in a floating-point environment of their own. They call the implementation
   through MODEL, so that no compiler moves its arithmetic out of there. */

#include "model.h"

#include "floating.h"

/* A call without a result. */
#define COMPUTE(call)                       \
    const Floating host = floating_enter(); \
    call;                                   \
    floating_leave(&host)

/* One with a result of a type. */
#define COMPUTE_AS(type, call)              \
    const Floating host = floating_enter(); \
    type const result = call;               \
    floating_leave(&host);                  \
    return result

Model *model_create(unsigned char *bytes, size_t length, char text[MODEL_TEXT_SIZE]) {
    COMPUTE_AS(Model *, MODEL.create(bytes, length, text));
}

void model_reset(Model *model) {
    COMPUTE(MODEL.reset(model));
}

int model_step(Model *model, double start, double end, char text[MODEL_TEXT_SIZE]) {
    COMPUTE_AS(int, MODEL.step(model, start, end, text));
}

void model_notice(Model *model, void (*function)(Model *model)) {
    if (function != NULL) {
        COMPUTE(function(model));
    }
}

int model_unsettled(Model *model) {
    COMPUTE_AS(int, MODEL.unsettled != NULL && MODEL.unsettled(model));
}

int model_event(Model *model, char text[MODEL_TEXT_SIZE]) {
    COMPUTE_AS(int, MODEL.event != NULL && MODEL.event(model, text));
}

int model_get(Model *model, Type type, const Selection *which, void *value, char text[MODEL_TEXT_SIZE]) {
    COMPUTE_AS(int, MODEL.get(model, type, which, value, text));
}

int model_set(Model *model, Type type, const Selection *which, const void *value, char text[MODEL_TEXT_SIZE]) {
    COMPUTE_AS(int, MODEL.set(model, type, which, value, text));
}
