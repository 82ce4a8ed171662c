/* Flight states that fit about as well as the estimated one, where navigation does not give the pressure:
   docs/explanation/nonlinear_estimator.md. */

#ifndef AMBIGUITY_H
#define AMBIGUITY_H

#include "../nonlinear/flight_solver.h"

/* Whether navigation gives neither p_inf nor q_inf. */
int flight_pressure_unknown(const FlightSolver *solver);

/* Excess of -2 ln likelihood by which another state is better and takes the place of the solution; and how much another one
   counts by its excess: wholly up to 16, not at all from 25 on, linearly between. */
#define BETTER 9.0
double flight_weight_of_excess(double excess);

/* Widen the covariances of the solution by factors on standard deviations (N_WIDENING). */
void flight_widen(FlightSolver *solver, const double *widening);

/* Widen the solution of a search by what else fits; and that from a state by what a search finds, or go over to an end of
   it that fits better. */
void flight_widen_searched(FlightSolver *solver);
void flight_search_more(FlightSolver *solver);

#endif
