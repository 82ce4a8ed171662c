/* What the files of the FMI 3.0 front have in common. A variable of FMI 3.0 is an array of the model. */

#ifndef FMI3_H
#define FMI3_H

#include "fmi3Functions.h"

#include "../core/instance.h"

#define FMI3_RUNNING (STEP | EVENT | CONTINUOUS_TIME)
#define FMI3_SETTABLE (INSTANTIATED | INITIALIZATION | CONFIGURATION | FMI3_RUNNING)
#define FMI3_READABLE (FMI3_SETTABLE | TERMINATED)

/* The scalar variables of a value reference; none for time and for what does not exist. */
static inline Selection fmi3_array(const Instance *instance, fmi3ValueReference reference) {
    return model_array(instance->model, reference);
}

/* Log that a variable is of another type; fmi3Error. */
fmi3Status fmi3_wrong_type(const Instance *instance, const char *function, fmi3ValueReference reference);

#endif
