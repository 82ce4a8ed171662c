/* What a sample of the filter reads, and the errors of it: strainfmu/estimator/reference/flight_filter.py. */

#ifndef FILTER_ROWS_H
#define FILTER_ROWS_H

#include "filter_state.h"

/* The errors at the state of solver->response: read but for x, term, white. Then the slopes of a response, H' of x in
   read; and with those the innovation about a state. */
void filter_set_errors(Filter *filter);
void filter_set_slopes(Filter *filter, const Response *response);
void filter_set_innovation(Filter *filter, const Law *law, const double *state);

#endif
