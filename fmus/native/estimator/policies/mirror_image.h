/* The mirror image of a flow, which gauges in use near one plane through the axis read alike:
   docs/explanation/nonlinear_estimator.md. */

#ifndef MIRROR_IMAGE_H
#define MIRROR_IMAGE_H

#include "../nonlinear/solver_state.h"

/* Where gauges are lost and the mirror image of the solution fits as well, add its difference to the covariances, or go
   over to it where it fits better. Residuals of air data are the solution's afterwards. */
void flight_look_at_mirror_image(FlightSolver *solver);

#endif
