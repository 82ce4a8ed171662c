/* Rolling moment and section loads at the law of the filter: strainfmu/estimator/reference/flight_filter.py. */

#ifndef FILTER_OTHER_H
#define FILTER_OTHER_H

#include "../nonlinear/flight_other_loads.h"
#include "filter_state.h"

/* Set out->value for the law of the last update, at the references of the settings. */
void filter_other_loads(Filter *filter, FlightOtherLoads *other_loads, const Inputs *inputs, OtherLoads *out);

#endif
