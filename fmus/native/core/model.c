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

void model_end_initialization(Model *model) {
    COMPUTE(MODEL.end_initialization(model));
}

int model_step(Model *model, double start, double end, char text[MODEL_TEXT_SIZE]) {
    COMPUTE_AS(int, MODEL.step(model, start, end, text));
}

void model_follow_event(Model *model) {
    if (MODEL.follow_event != NULL) {
        COMPUTE(MODEL.follow_event(model));
    }
}

void model_accept_step(Model *model) {
    if (MODEL.accept_step != NULL) {
        COMPUTE(MODEL.accept_step(model));
    }
}

void model_settle(Model *model) {
    if (MODEL.settle != NULL) {
        COMPUTE(MODEL.settle(model));
    }
}

int model_unsettled(Model *model) {
    if (MODEL.unsettled == NULL) {
        return 0;
    }
    COMPUTE_AS(int, MODEL.unsettled(model));
}

int model_event(Model *model, char text[MODEL_TEXT_SIZE]) {
    if (MODEL.event == NULL) {
        return 0;
    }
    COMPUTE_AS(int, MODEL.event(model, text));
}

/* Reading and setting of variables. */
#define VALUES(name, type)                                                                            \
    int model_##name(Model *model, const Selection *which, type *value, char text[MODEL_TEXT_SIZE]) { \
        COMPUTE_AS(int, MODEL.name(model, which, value, text));                                       \
    }

VALUES(get_reals, double)
VALUES(get_integers, int)
VALUES(get_booleans, int)
VALUES(set_reals, const double)
VALUES(set_integers, const int)
VALUES(set_booleans, const int)

int model_check_state(const Model *model, const unsigned char *bytes, char text[MODEL_TEXT_SIZE]) {
    COMPUTE_AS(int, MODEL.check_state(model, bytes, text));
}
