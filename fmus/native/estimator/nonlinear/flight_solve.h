/* The flight state that fits strain and navigation, and loads, residuals and covariances that follow from it. */

#ifndef FLIGHT_SOLVE_H
#define FLIGHT_SOLVE_H

#include "flight_solver.h"

/* Solve for solver->sample by a fixed number of iterations from a state. Then the solution is in solver->solution. */
void flight_solve_warm(FlightSolver *solver, const double *state);

/* The solution that iterations have ended with before, at solver->state with S at solver->factor_state. */
void flight_solve_again(FlightSolver *solver, const double *weighted_at, const double *state);

/* What it takes to have a solution again: its state and S's, what counts of navigation, residuals of it, and widening. */
typedef struct {
    double state[N_STATES], weighted_at[N_STATES];
    double precision[N_NAVIGATION], residual[N_NAVIGATION], widening[N_WIDENING];
} KeptSolution;

KeptSolution flight_keep(const FlightSolver *solver);

/* The same but for its widening. */
void flight_take_again(FlightSolver *solver, const KeptSolution *kept);

/* The parts of it: S renewed half-way, and what shows the best end of a search; the solution from a state; the problem about
   a state weighted by the last S, and by S there; -2 ln likelihood of the problem, less a constant. */
double flight_iterate_start(FlightSolver *solver, double *state);
void flight_solve_from(FlightSolver *solver, const double *state);
void flight_linearise_at(FlightSolver *solver, const double *state);
void flight_linearise_anew(FlightSolver *solver, const double *state);
double flight_deviance(const FlightSolver *solver);

/* The full model at the state of the problem, of which the first n_free elements are free. */
void flight_weigh_full(FlightSolver *solver, size_t n_free);

/* Its standardised residuals of the gauges, which settling leaves as they were. */
void flight_set_gauge_residuals(FlightSolver *solver);

/* Row of the measurement's Jacobian, of a derivative of ln q_inf by the Mach number. */
void flight_measurement_row(double log_mach_slope, size_t which, double *row);

/* A step from a state, not too long, and inside the reach of the tables. */
void flight_limited(const FlightMap *map, const double *from, const double *step, double *state);

#endif
