/* Loads in addition to the five by the linear estimator. */

#ifndef LINEAR_OTHER_H
#define LINEAR_OTHER_H

#include "linear_state.h"

/* Set linear->other_loads->value for the last step. */
void linear_other_loads_update(Linear *linear);

#endif
