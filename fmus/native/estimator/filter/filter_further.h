/* Rolling moment and section loads at the law of the filter: strainfmu/estimator/reference/flight_filter.py. */

#ifndef FILTER_FURTHER_H
#define FILTER_FURTHER_H

#include "../nonlinear/flight_further.h"
#include "filter_state.h"

/* Set out->value for the law of the last update, at the references of the settings. */
void filter_further_loads(Filter *filter, FlightFurther *further, const Inputs *inputs, Further *out);

#endif
