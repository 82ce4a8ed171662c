/* The law after a sample: strainfmu/estimator/reference/kalman.py. */

#ifndef FILTER_UPDATE_H
#define FILTER_UPDATE_H

#include "filter_state.h"

/* The law after the sample whose slopes and innovation are whitened, and the normalised innovation squared. */
double filter_update_law(Filter *filter, const Law *law, Law *after);

/* The flight state gets a value, from which the others follow by their covariance: its square distance. */
double filter_give(Filter *filter, Law *law, const double *state);

#endif
