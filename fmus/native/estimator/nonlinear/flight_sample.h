/* What is known of a sample: strain of the gauges in use, navigation, the ranges of the map. */

#ifndef FLIGHT_SAMPLE_H
#define FLIGHT_SAMPLE_H

#include "../sample/inputs.h"
#include "solver_state.h"

/* Take the gauges in use and their strain, at the reference temperature; their number. */
size_t flight_set_strain(FlightSolver *solver, const Inputs *inputs);

/* Navigation of the inputs, each with a deviation (N_NAVIGATION); NaN where not known. */
void navigation_of(const FlightMap *map, const Inputs *inputs, double *value, double *std);

/* What navigation, of these values and deviations, and the ranges of the map say of the flight state. */
void flight_set_measurement(FlightSolver *solver, const double *navigation, const double *navigation_std);

#endif
