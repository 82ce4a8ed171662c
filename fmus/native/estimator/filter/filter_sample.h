/* A sample by the filter: strainfmu/estimator/reference/flight_filter.py, kalman.py. */

#ifndef FILTER_SAMPLE_H
#define FILTER_SAMPLE_H

#include "filter_state.h"

/* Estimate solver->sample from a predicted law, by iterations from a flight state: the solution in solver->solution, the
   law after it in filter->laws.next_law. Slopes are those at a flight state; NULL for each iteration's own. */
void filter_sample(Filter *filter, const Law *law, const double *start, size_t iterations, const double *slopes);

#endif
