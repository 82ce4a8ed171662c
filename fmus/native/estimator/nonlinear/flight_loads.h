/* Loads of tables at a solution, corrected by strain: strainfmu/estimator/reference/nonlinear.py has the formulas. */

#ifndef FLIGHT_LOADS_H
#define FLIGHT_LOADS_H

#include "solver_state.h"

/* Loads and coefficients of the solution, from its state and the problem about it. */
void flight_set_loads(FlightSolver *solver);

/* q_inf of the solution [Pa], the derivative of its logarithm by the state, and the variance that covers its error over
   the variance of the logarithm. */
typedef struct {
    double dynamic, by_state[N_STATES], wider;
} PressureErrors;

PressureErrors flight_pressure_errors(const FlightSolver *solver);

/* What considered error `error` adds to a load: by its change of the state, of which `by_state` are the derivatives,
   and at a fixed state, `scale` of it; `turned` as below. */
double flight_considered(const FlightSolver *solver, size_t error, size_t load, const double *turned, double scale,
                         const double *by_state);

/* L^-1 of `count` covariances with strain (count, n_gauges), per p_inf^2, in turned (count, n). */
void flight_turn(const FlightSolver *solver, const double *strain_covariance, size_t count, double *turned);

/* A row of a response at the solution, corrected by the residual of strain, and its derivatives by the state; `turned`
   (n) is that row of flight_turn. */
double flight_corrected(const FlightSolver *solver, const Response *response, size_t row, const double *turned,
                        double *by_state);

/* The relative standard deviation of a lognormal value, of which three reach as far as three of its logarithm's. */
double lognormal_deviation(double of_log);

#endif
