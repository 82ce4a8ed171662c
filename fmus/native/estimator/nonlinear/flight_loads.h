/* Loads of tables at a solution, corrected by strain: strainfmu/estimator/reference/nonlinear.py has the formulas. */

#ifndef FLIGHT_LOADS_H
#define FLIGHT_LOADS_H

#include "../sample/inputs.h"
#include "../sample/outputs.h"
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

/* L^-1 of `count` covariances with strain (count, n_gauges), per p_inf^2, in turned (count, n). */
void flight_turn(const FlightSolver *solver, const double *strain_covariance, size_t count, double *turned);

/* A row of a response at the solution, corrected by the weighted residual in `right`, and its derivatives by the state;
   `turned` (n) is that row of flight_turn. */
double flight_corrected(const FlightSolver *solver, const double *right, const Response *response, size_t row,
                        const double *turned, double *by_state);

/* Angles, Mach number and pressures of a flight state: strainfmu/estimator/reference/air.py. */

#define N_AIR_DATA 7

enum { ANGLE_OF_ATTACK, SIDESLIP_ANGLE, TOTAL_INCIDENCE, WIND_ROLL_ANGLE, AIR_MACH_NUMBER, AIR_PRESSURE, AIR_DYNAMIC };

/* Air data of a solution, (2, N_AIR_DATA) with their sigmas, and whether each is identified: better known than by the
   ranges of the map, whose standard deviations are prior_std (N_STATES). */
void flight_air_data(const FlightMap *map, const double *prior_std, const Solution *solution, double *value,
                     unsigned char *is_identified);

/* Loads in addition to the five over the flight state, part "flight_loads" of resources/map.bin. */

typedef struct {
    TableMap tables;                 /* a row per load, on the knots of the tables of strain; no rows in maps without */
    MAP_MEMBERS(FLIGHT_LOADS)
} FlightOtherLoadsMap;

typedef struct {
    FlightOtherLoadsMap map;
    FlightTables tables;
    Response response;
    double *turned; /* (n_loads, n) L^-1 of strain_covariance, n_gauges in lanes */
    double *full_turned; /* (n_loads, n) the same of the full model */
    double *others; /* (MOST_OTHERS, n_loads) of the tables at other solutions */
} FlightOtherLoads;

/* Read the part of n_loads loads in addition to the tables of `flight`. 1; 0 with a text. */
int flight_other_loads_parse(MapFile *file, const FlightMap *flight, size_t n_loads, FlightOtherLoadsMap *map);

/* Hand out the arrays, filled in. */
void flight_other_loads_arrays(FlightOtherLoads *other_loads, size_t n_gauges, Room *room);

/* Set out->value for the solution, at the references of the settings. */
void flight_other_loads_at(FlightOtherLoads *other_loads, const FlightSolver *solver, const Inputs *inputs, OtherLoads *out);

/* All of them are not known. */
void other_loads_unknown(OtherLoads *out);

#endif
