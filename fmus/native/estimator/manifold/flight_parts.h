/* Parts of a step of the nonlinear estimator that it has with and without the filter. */

#ifndef FLIGHT_PARTS_H
#define FLIGHT_PARTS_H

#include <math.h>

#include "../estimator.h"

/* Take the gauges in use and their strain, at the reference temperature; their number. */
size_t flight_set_strain(Estimator *e);

/* What navigation and the ranges of the map say of the flight state. */
void flight_set_measurement(Flight *flight);

/* Whether a quantity of navigation fits strain and the others so badly that it is dropped: the worst one. Below the
   alarm it may as well be another one that is wrong: then they count with larger deviations. */
int flight_drop_inconsistent(Flight *flight);

/* Write the solution to the outputs; whether strain and navigation fit the tables. */
int flight_conclude(Estimator *e, size_t used);

/* Loads of the linear map in place of those of the tables, where it has some, and where these do not fit or have not for
   long enough. */
void flight_fall_back(Estimator *e, int fits, double to_return);

/* Nothing is known, and the step leaves what it found. */
void flight_set_nothing_known(Estimator *e);

/* Number of quantities of navigation in use; whether one has a value that is not used, and that is no correct one. */
size_t flight_navigation_used(const Flight *flight);
int flight_navigation_alarms(const Flight *flight);

/* The deviation of a quantity of navigation without its own: of M [1], relative ones of p_inf, which the altitude tells
   less exactly, and q_inf. */
double flight_navigation_error(const Estimator *e, size_t quantity);

/* Difference of two sums of squares from which the quantity that leaves the larger one is not the wrong one: navigation.py. */
#define DISCERNED 16.0

/* Whether another quantity of navigation may be the wrong one, or none, where one is dropped; of their residuals. */
static inline int navigation_may_be_wrong(const Flight *flight, double dropped, double other) {
    return fabs(dropped) <= flight->map.navigation_alarm || dropped * dropped - other * other < DISCERNED;
}

/* Steps since the last search of the tables, as the step leaves them. */
double flight_since_search(const Flight *flight, int searched);

/* Steps that still must fit after one more that does. */
static inline double flight_waiting(const Flight *flight) {
    return flight->base.to_return > 1.0 ? flight->base.to_return - 1.0 : 0.0;
}

#endif
