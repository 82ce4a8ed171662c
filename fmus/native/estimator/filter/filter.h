/* Laws of the filter's states over time: strainfmu/estimator/reference/flight_filter.py, kalman.py. */

#ifndef FILTER_H
#define FILTER_H

#include "filter_state.h"

/* Fill in the sizes, and how many doubles it takes; handing them out. The first n_strains gauges have zeros. */
size_t filter_doubles(Filter *filter, FlightSolver *solver, const Thermal *thermal, size_t n_strains);
void filter_arrays(Filter *filter, double **doubles);

/* Forget all steps. */
void filter_reset(Filter *filter);

/* The state: the track, then the law; whether such bytes may be read. */
size_t filter_state_size(const Filter *filter);
void filter_write_state(const Filter *filter, unsigned char *bytes);
int filter_state_fits(const Filter *filter, const unsigned char *bytes);
void filter_read_state(Filter *filter, const unsigned char *bytes);

/* Set the time constant [s]; the law of which nothing has been measured follows, in laws.stationary. */
void filter_set_time_constant(Filter *filter, double time_constant);

#endif
