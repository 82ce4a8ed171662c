/* Flight states that fit about as well as the estimated one: where navigation does not give the pressure, and other flows that
   the gauges in use read alike where some are lost, or where inertia may have strained them: mirror images of gauges near one
   plane through the axis, several solutions of a few gauges. docs/explanation/nonlinear_estimator.md. */

#ifndef AMBIGUITY_H
#define AMBIGUITY_H

#include "../nonlinear/flight_solver.h"

/* Whether navigation gives neither p_inf nor q_inf. */
int flight_pressure_unknown(const FlightSolver *solver);

/* Widen the covariances of the solution by factors on standard deviations (N_WIDENING). */
void flight_widen(FlightSolver *solver, const double *widening);

/* Widen the solution of a search by what else fits; and that from a state by what a search finds, or go over to an end of
   it that fits better. */
void flight_widen_searched(FlightSolver *solver);
void flight_search_more(FlightSolver *solver);

int flight_gauges_are_lost(const FlightSolver *solver);

/* Add the differences to other solutions that fit as well to the covariances, or go over to one that
   fits better. Residuals of air data stay. */
void flight_look_for_others(FlightSolver *solver);

#endif
