/* What the files of the FMI 3.0 front have in common. A variable of FMI 3.0 is an array of the model or, from
   FMI3_FIRST_SCALAR on, one of its scalar variables: a description may list either. */

#ifndef FMI3_H
#define FMI3_H

#include "fmi3Functions.h"

#include "../core/instance.h"

/* Value reference of the scalar variable 0; strainfmu/fmu/description/model_description.py states the same. */
#define FMI3_FIRST_SCALAR 1000000u

/* Value reference of the first variable of the first port: received data, data to send, their clocks, then counters.
   Those of the next port follow. */
#define FMI3_FIRST_PORT 2000000u
#define FMI3_REFERENCES_OF_PORT 32u

/* The parameters that every function of variables begins with. */
#define VARIABLES fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences

/* The scalar variables of a value reference; none for time and for what does not exist. */
static inline Selection fmi3_array(const Instance *instance, fmi3ValueReference reference) {
    if (reference >= FMI3_FIRST_PORT) {
        return (Selection){NULL, 0, 0};
    }
    if (reference >= FMI3_FIRST_SCALAR) {
        const size_t variable = reference - FMI3_FIRST_SCALAR;
        return (Selection){NULL, variable, model_type_of(instance->model, variable) != NO_VARIABLE};
    }
    return model_array(instance->model, reference);
}

/* Whether a triggered transmit clock ticks now. */
int fmi3_is_due(const Instance *instance);

/* Log that a variable is of another type; fmi3Error. */
fmi3Status fmi3_wrong_type(const Instance *instance, const char *function, fmi3ValueReference reference);

#endif
