/* Other flows that gauges in use read alike where some are lost, or where inertia may have strained them: mirror images of
   gauges near one plane through the axis, several solutions of a few gauges. docs/explanation/nonlinear_estimator.md. */

#ifndef OTHER_SOLUTIONS_H
#define OTHER_SOLUTIONS_H

#include "../nonlinear/flight_solver.h"

int flight_gauges_are_lost(const FlightSolver *solver);

/* Add the differences to other solutions that fit as well to the covariances, or go over to one that
   fits better. Residuals of air data stay. */
void flight_look_for_others(FlightSolver *solver);

#endif
