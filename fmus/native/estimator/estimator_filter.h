/* The filter of an estimator: what its channels are, and where filtered values go. */

#ifndef ESTIMATOR_FILTER_H
#define ESTIMATOR_FILTER_H

#include "estimator.h"

/* Read the filter's part and allocate, after all other parts. 1; 0 after a message. */
int estimator_filter_create(Estimator *estimator, MapFile *file);

/* Whether samples are filtered: the time constant is positive, and the instance takes steps. */
int estimator_filters(const Estimator *estimator);

/* Filter the outputs, which are those of the sample alone. */
void estimator_filter_outputs(Estimator *estimator);

#endif
