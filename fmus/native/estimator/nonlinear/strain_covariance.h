/* The covariance of strain about the tables: strainfmu/estimator/reference/nonlinear.py. */

#ifndef STRAIN_COVARIANCE_H
#define STRAIN_COVARIANCE_H

#include "solver_state.h"

/* S about the state of solver->response, in solver->factor, before it is decomposed; all gauges. */
void flight_strain_covariance(FlightSolver *solver);

/* The same of S with the considered errors, in solver->full.factor; solver->full.response has those with tables. */
void flight_full_covariance(FlightSolver *solver);

#endif
