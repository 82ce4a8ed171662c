/* Derivatives of loads, coefficients and air data: differences of fourth order of the estimates that the iterations end at.

   The nonlinear estimator takes steps with the same inputs until they no longer move the flight state; with a filter it is
   the one step, from what the steps before left. Searches and waiting for the tables are held as they are. */

#ifndef ESTIMATOR_DERIVATIVE_H
#define ESTIMATOR_DERIVATIVE_H

#include "estimator.h"

/* Derivatives of the estimate along a direction of the inputs (inputs_count), which is scratch: estimator_derivatives of
   them; for loads, coefficients and air data they are good, NaN where the output is. The estimator is left as it was. 1; 0,
   after a message, where it has none. */
int estimator_derivative(Estimator *estimator, double *direction, double *derivative, char text[MODEL_TEXT_SIZE]);

#endif
