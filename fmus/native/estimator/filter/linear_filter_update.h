/* A sample by the filter of a linear map: strainfmu/estimator/reference/linear_filter.py. */

#ifndef LINEAR_FILTER_UPDATE_H
#define LINEAR_FILTER_UPDATE_H

#include "linear_filter.h"

/* Rows of the sample in filter->used, filter->apart and filter->ratio; then filter->of_load, and what the sample says
   alone. */
void linear_filter_read(LinearFilter *filter);

/* filter->next_law from a law, with the sample; its normalised innovation squared. */
double linear_filter_update(LinearFilter *filter, const Law *law);

/* Change of the five loads by a law in place of the sample alone, and of their covariance. */
void linear_filter_loads(LinearFilter *filter, const Law *law, double *loads, double *covariance);

#endif
