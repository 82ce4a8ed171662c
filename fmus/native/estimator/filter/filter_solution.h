/* Loads and coefficients at a law of the filter: strainfmu/estimator/reference/flight_filter.py. */

#ifndef FILTER_SOLUTION_H
#define FILTER_SOLUTION_H

#include "filter_state.h"

/* solver->solution at the law in filter->laws.next_law, the last sample's. */
void filter_solution(Filter *filter);

/* What the gauges in use read beside all states of a law, (rows) in filter->product. */
double *filter_left(Filter *filter, const Law *law);

#endif
