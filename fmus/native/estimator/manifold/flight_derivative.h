/* Derivatives of the outputs of the nonlinear estimator. */

#ifndef FLIGHT_DERIVATIVE_H
#define FLIGHT_DERIVATIVE_H

#include "../estimator.h"

/* Derivatives of all outputs along d_input, of which the strains are those that the map sees; air data and their
   deviations follow the others, then rolling moment and section loads. 1; 0 with a text where there are none. */
int flight_derivative(Estimator *e, const double *d_input, double *d_output, char text[MODEL_TEXT_SIZE]);

/* What the derivatives of rolling moment and section loads at a solution have in common; these, along a change of the
   solution, as estimator->further has the loads. */
void further_tangents_prepare(Flight *flight);
void derive_further(Estimator *e, const double *d_input, const SolutionChange *change, double *d_further);

/* Of the air data and their deviations, along a change of state and covariance, in d_real (N_FLIGHT_REALS). */
void derive_air_data(const Flight *flight, const SolutionChange *change, double *d_real);

#endif
