/* What the files of FMI 2.0 share. */

#ifndef FMI2_COMMON_H
#define FMI2_COMMON_H

#include "fmi2Functions.h"

#include "instance.h"

#define FMI2_RUNNING (STEP | EVENT | CONTINUOUS_TIME)
#define FMI2_SETTABLE (INSTANTIATED | INITIALIZATION | FMI2_RUNNING)
#define FMI2_READABLE (FMI2_SETTABLE | TERMINATED)

/* An argument that must not be NULL; if it is, a message says so. */
int fmi2_given(const Instance *instance, const char *function, const void *argument);

#endif
