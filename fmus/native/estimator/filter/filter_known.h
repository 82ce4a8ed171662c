/* Errors of pressure in the filter where flow parameters are known: those in the directions of the map, of what is left. */

#ifndef FILTER_KNOWN_H
#define FILTER_KNOWN_H

#include "../nonlinear/flight_known.h"
#include "filter_state.h"

/* Arrays beside those of the map, for n_parameters that are set. */
size_t filter_known_doubles(const Filter *filter);
void filter_known_arrays(Filter *filter, double **doubles);

/* The errors of the sample, in filter->errors, and the deviations of what is known, in laws.stated. */
void filter_follow_known(Filter *filter, const Known *known);

#endif
