/* Variables of the estimator by number: what each stands for. estimator_variables.c lists them. */

#ifndef ESTIMATOR_VARIABLES_H
#define ESTIMATOR_VARIABLES_H

#include "../../core/model.h"
#include "../estimator.h"

static inline Estimator *estimator_of(const Model *model) {
    return (Estimator *)(uintptr_t)model; /* its first member */
}

/* What a variable stands for. First what estimator_outputs computes: a number of estimator->output, of the nonlinear
   estimator's real outputs or flags, of the values of other loads. Then one of inputs.value, of inputs.valid, of the tare; a
   zero in use; the score of a flow parameter. */
typedef enum {
    OUTPUT, AIR_DATA, FLIGHT_FLAG, OTHER_LOAD, INPUT, VALID, TARE_INPUT, TARE_STATE, ZERO_IN_USE, SCORE, USABLE, NOTHING
} VariableKind;

typedef struct {
    VariableKind kind;
    size_t place; /* among those of its kind */
} Variable;

/* The variable of a number; NOTHING where there is none. */
Variable variable_of(const Estimator *e, size_t number);

/* Its type; NO_VARIABLE for NOTHING. */
Type variable_type(const Estimator *e, Variable variable);

/* Value reference of FMI 3.0 of the time, behind all arrays. */
unsigned time_reference(const Estimator *e);

#endif
