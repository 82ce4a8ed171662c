/* Starts of the iterations where no last state is known: strainfmu/estimator/reference/nonlinear.py. */

#ifndef FLIGHT_SEARCH_H
#define FLIGHT_SEARCH_H

#include "solver_state.h"

/* Solve for solver->sample from a search of the tables. Then the solution is in solver->solution. */
void flight_solve_cold(FlightSolver *solver);

/* Where the search ends, in solver->end, and the best of them. */
size_t flight_search_ends(FlightSolver *solver);

/* Fill in the states of the search, or the weights of the gauges in it alone. */
void flight_search_prepare(FlightSolver *solver);
void flight_search_weigh(FlightSolver *solver);

#endif
