/* Starts of the iterations where no last state is known: strainfmu/estimator/reference/nonlinear.py. */

#ifndef FLIGHT_SEARCH_H
#define FLIGHT_SEARCH_H

#include "flight_solver.h"

/* Solve for solver->sample from a search of the tables. Then the solution is in solver->solution. */
void flight_solve_cold(FlightSolver *solver);

/* Where the search ends, in solver->end, and the best of them. A step searches at most KEPT_SEARCHES times, once for the
   same navigation: after that the last ends stay. Whether they are for the navigation at hand. */
size_t flight_search_ends(FlightSolver *solver);
int flight_search_kept(const FlightSolver *solver);

/* The best minima of the search's states, over incidence and roll angle, that are not near a state; their number. */
size_t flight_search_minima(FlightSolver *solver, const double *state, double minimum[MOST_MINIMA][N_STATES]);

/* Fill in the states of the search, or the weights of the gauges in it alone. */
void flight_search_prepare(FlightSolver *solver);
void flight_search_weigh(FlightSolver *solver);

#endif
