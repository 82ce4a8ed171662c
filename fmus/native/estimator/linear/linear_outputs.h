/* Loads, coefficients, limits and suspects of a step of a linear map. */

#ifndef LINEAR_OUTPUTS_H
#define LINEAR_OUTPUTS_H

#include "linear_state.h"

/* Condition the loads on the strains, and set all outputs but the number of gauges and the health, where the gauges in use
   identify the state; of form "dynamic_pressure" where q_inf is known. */
void linear_outputs(Linear *linear);

/* Set linear->other_loads->value for the last step. */
void linear_other_loads_update(Linear *linear);

#endif
