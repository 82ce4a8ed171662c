/* One sample after another by the filter of a linear map: strainfmu/estimator/reference/linear_filter.py. */

#ifndef LINEAR_FILTER_STEP_H
#define LINEAR_FILTER_STEP_H

#include "../linear/linear_state.h"
#include "linear_filter.h"

/* Change loads and coefficients, which are those of the sample alone, by what is known of the samples before. */
void linear_filter_outputs(LinearFilter *filter, Linear *linear);

/* What the last step left is what the next one starts from, at a point in time [s]. */
void linear_filter_take_next(LinearFilter *filter, double time);

#endif
