/* The covariance of the filter's states with the errors that are considered: strainfmu/estimator/reference/kalman.py. */

#ifndef FILTER_CROSS_H
#define FILTER_CROSS_H

#include "filter_state.h"

/* C G' of a law, in filter->considered; C after a sample, but for errors of zeros. */
void filter_set_considered(Filter *filter, const Law *law);
void filter_update_cross(Filter *filter, const Law *law, Law *after);

#endif
