/* Loads of tables at a solution, corrected by strain: strainfmu/estimator/reference/nonlinear.py has the formulas. */

#ifndef FLIGHT_LOADS_H
#define FLIGHT_LOADS_H

#include "flight_solver.h"

/* Loads and coefficients of the solution, from its state and the problem about it; their covariances, and the state's, by
   the full model. */
void flight_set_loads(FlightSolver *solver);

/* q_inf of the solution [Pa], the derivative of its logarithm by the state, the logarithm less the full model's, and the
   variance that covers its error over the variance of the logarithm. */
typedef struct {
    double dynamic, by_state[N_STATES], apart, wider;
} PressureErrors;

PressureErrors flight_pressure_errors(const FlightSolver *solver);

/* L^-1 of `count` covariances with strain (count, n_gauges), per p_inf^2, in turned (count, n); and the same of the full
   model, with those of the considered errors, for loads from `first` on. */
void flight_turn(const FlightSolver *solver, const double *strain_covariance, size_t count, double *turned);
void flight_turn_full(const FlightSolver *solver, const double *strain_covariance, const double *considered, size_t first,
                      size_t count, double *turned);

/* A row of a response at the solution, corrected by the weighted residual in `right`, and its derivatives by the state;
   `turned` (n) is that row of flight_turn. */
double flight_corrected(const FlightSolver *solver, const double *right, const Response *response, size_t row,
                        const double *turned, double *by_state);

/* Derivatives of a load and of its coefficient by the state in the full model, and what they are apart from its estimates. */
typedef struct {
    double by_state[N_STATES], apart, of_coefficient[N_STATES], coefficient_apart;
} LoadErrors;

/* Of a row of a response whose value is `value`; `turned` (n) is that row of flight_turn_full. */
LoadErrors flight_load_errors(const FlightSolver *solver, const PressureErrors *pressure, const Response *response,
                              size_t row, double value, const double *turned, double scale);

/* What strain leaves at a fixed state of the product of two loads, `square` per p_inf^2. */
double flight_load_square(const FlightSolver *solver, double square, size_t load, size_t other, const double *turned,
                          const double *other_turned);

/* Angles, Mach number and pressures of a flight state: strainfmu/estimator/reference/air.py. */

#define N_AIR_DATA 7

enum { ANGLE_OF_ATTACK, SIDESLIP_ANGLE, TOTAL_INCIDENCE, WIND_ROLL_ANGLE, AIR_MACH_NUMBER, AIR_PRESSURE, AIR_DYNAMIC };

/* Air data of a solution, (2, N_AIR_DATA) with their sigmas, and whether each is identified: better known than by the
   ranges of the map, whose standard deviations are prior_std (N_STATES). */
void flight_air_data(const FlightMap *map, const double *prior_std, const Solution *solution, double *value,
                     unsigned char *is_identified);

#endif
