/* What the files of FMI 3.0 share: how its array variables lie in the scalar variables of variables.h. */

#ifndef FMI3_COMMON_H
#define FMI3_COMMON_H

#include "fmi3Functions.h"

#include "variables.h"

#define TIME_REFERENCE 21u /* the independent variable */

/* The scalar variables that an FMI 3.0 variable is made of. */
typedef struct {
    size_t first, count;
} Span;

/* The span of a value reference; of count 0 for time and for what does not exist. */
Span fmi3_span(const Estimator *e, fmi3ValueReference reference);

/* Whether the lists are there, and nValues is the number of values that nReferences variables have; if not, or if the
   instance is in none of the modes, a message says so. */
int fmi3_lists_fit(Instance *instance, const char *function, int modes, const fmi3ValueReference references[],
                   size_t nReferences, const void *values, size_t nValues);

/* An argument that must not be NULL. */
int fmi3_given(const Instance *instance, const char *function, const void *argument);

fmi3Status fmi3_wrong_type(const Instance *instance, const char *function);

#define FMI3_RUNNING (STEP | EVENT | CONTINUOUS_TIME)
#define FMI3_SETTABLE (INSTANTIATED | INITIALIZATION | CONFIGURATION | FMI3_RUNNING)
#define FMI3_READABLE (FMI3_SETTABLE | TERMINATED)

#endif
