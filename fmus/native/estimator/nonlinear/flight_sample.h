/* What is known of a sample: strain of the gauges in use, navigation, the ranges of the map. */

#ifndef FLIGHT_SAMPLE_H
#define FLIGHT_SAMPLE_H

#include "../sample/inputs.h"
#include "flight_solver.h"

/* Take the gauges in use and their strain, at the reference temperature; their number. */
size_t flight_set_strain(FlightSolver *solver, const Inputs *inputs);

/* Navigation of the inputs, each with a standard deviation; NaN where not known. */
typedef struct {
    double value[N_NAVIGATION], std[N_NAVIGATION];
    int is_computed;    /* whether q_inf was computed from the others: nothing confirms them then */
    double of_loads[2]; /* q_inf and its sigma for loads of the linear map, also where it is computed and no value */
} Navigation;

void navigation_of(const FlightMap *map, const Inputs *inputs, Navigation *navigation);

/* What navigation, of these values and standard deviations, and the ranges of the map say of the flight state. */
void flight_set_measurement(FlightSolver *solver, const double *navigation, const double *navigation_std);

#endif
