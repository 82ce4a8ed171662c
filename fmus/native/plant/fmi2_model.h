/* What the functions of FMI 2.0 share: an instance of a model, and how it speaks. */

#ifndef FMI2_MODEL_H
#define FMI2_MODEL_H

#include "fmi2Functions.h"
#include "model.h"

#define BEFORE_STEPS (INSTANTIATED | INITIALIZATION)
#define SETTABLE (BEFORE_STEPS | STEP)
#define READABLE (SETTABLE | TERMINATED)

typedef struct {
    Model *model;
    char *name;
    fmi2CallbackLogger logger;
    fmi2ComponentEnvironment environment;
    int terminated;              /* whether the last step was discarded: the model wants to end */
    double last_successful_time; /* then the end of the last step that was not [s] */
} Instance;

/* Log a message as printf does; return the status. */
fmi2Status fmi2_tell(const Instance *s, fmi2Status status, const char *format, ...);

/* Whether there is an instance, in one of the modes, and `length` elements at each of two arrays. */
int fmi2_allowed(const Instance *s, const char *function, int modes, size_t length, const void *a, const void *b);

#endif
