/* Memory of the nonlinear solver, and the errors that its gauges have. */

#ifndef FLIGHT_SOLVER_H
#define FLIGHT_SOLVER_H

#include "solver_state.h"

/* Hand out the arrays, filled in. */
void flight_solver_arrays(const FlightMap *map, size_t n_gauges, int wide, FlightSolver *solver, Room *room);

/* Give the gauges errors of the covariance `own` (n_gauges, n_gauges), NULL for the map's, and of `added`. */
void flight_solver_add_noise(FlightSolver *solver, const double *own, const double *added);

#endif
