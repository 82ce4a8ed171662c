/* Flight states that fit about as well as the estimated one, where navigation does not tell the pressure:
   docs/explanation/nonlinear_estimator.md. */

#ifndef AMBIGUITY_H
#define AMBIGUITY_H

#include "../nonlinear/solver_state.h"

/* Whether navigation tells neither p_inf nor q_inf. */
int flight_pressure_untold(const FlightSolver *solver);

/* Solve from a search, with what else fits; and from a state, with what a search finds that fits as well, or better. */
void flight_search_widened(FlightSolver *solver);
void flight_search_again(FlightSolver *solver, const double *state);

/* Widen the covariances of the solution by factors on deviations (N_WIDENING). */
void flight_widen(FlightSolver *solver, const double *widening);

#endif
