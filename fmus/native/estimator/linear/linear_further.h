/* Loads beside the five by the linear estimator: rolling moment, and loads of sections. */

#ifndef LINEAR_FURTHER_H
#define LINEAR_FURTHER_H

#include "linear_state.h"

/* Set linear->further->value for the last step. */
void linear_further_update(Linear *linear);

#endif
