/* Laws of the filter's states over time: strainfmu/estimator/reference/flight_filter.py, kalman.py. */

#ifndef FILTER_H
#define FILTER_H

#include "filter_state.h"

/* Fill in the sizes, and how many doubles it takes; handing them out. The first n_strains gauges have zeros. */
size_t filter_doubles(Filter *filter, FlightSolver *solver, const Thermal *thermal, size_t n_strains);
void filter_arrays(Filter *filter, double **doubles);

/* Forget all steps. */
void filter_reset(Filter *filter);

/* Number of doubles of a law; writing filter->law, without what it says of zeros where none has a deviation. */
size_t law_doubles(const Filter *filter);
void filter_write_law(const Filter *filter, unsigned char *bytes);

/* Whether a serialised track, and a law, may be read. */
int filter_track_fits(const Filter *filter, const FilterTrack *track, const unsigned char *law);

/* Set the time constant [s]; the law of which nothing has been measured follows, in filter->stationary. */
void filter_set_time_constant(Filter *filter, double time_constant);

/* filter->predicted from filter->law, over a time step [s]. */
void filter_predict(Filter *filter, double time_step);

/* to = scale F from, of `count` columns, for the last such step. */
void filter_move_rows(const Filter *filter, size_t count, double scale, const double *from, double *to);

#endif
