/* The covariance of strain about the tables: strainfmu/estimator/reference/nonlinear.py. */

#ifndef STRAIN_COVARIANCE_H
#define STRAIN_COVARIANCE_H

#include "solver_state.h"

/* Columns of the errors that all gauges have in common, in solver->columns, and variances of each gauge in own (n). */
void flight_proportional_errors(FlightSolver *solver, double *own);

/* S about the state of solver->response, in solver->factor, before it is decomposed; all gauges. */
void flight_strain_covariance(FlightSolver *solver);

#endif
