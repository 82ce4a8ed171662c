/* What the files of the FMI 2.0 front have in common. */

#ifndef FMI2_H
#define FMI2_H

#include "fmi2Functions.h"

#include "../core/instance.h"

#define FMI2_RUNNING (STEP | EVENT | CONTINUOUS_TIME)
#define FMI2_SETTABLE (INSTANTIATED | INITIALIZATION | FMI2_RUNNING)
#define FMI2_READABLE (FMI2_SETTABLE | TERMINATED)

#endif
