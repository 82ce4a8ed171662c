/* Angles, Mach number and pressures of a flight state: strainfmu/estimator/reference/air.py. */

#ifndef FLIGHT_AIR_DATA_H
#define FLIGHT_AIR_DATA_H

#include "solver_state.h"

#define N_AIR_DATA 7

enum { ANGLE_OF_ATTACK, SIDESLIP_ANGLE, TOTAL_INCIDENCE, WIND_ROLL_ANGLE, AIR_MACH_NUMBER, AIR_PRESSURE, AIR_DYNAMIC };

/* Air data of a solution, (2, N_AIR_DATA) with their sigmas, and whether each is identified: better known than by the
   ranges of the map, whose standard deviations are prior_std (N_STATES). */
void flight_air_data(const FlightMap *map, const double *prior_std, const Solution *solution, double *value,
                     unsigned char *is_identified);

#endif
