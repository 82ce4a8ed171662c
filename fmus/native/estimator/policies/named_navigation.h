/* Navigation whose error changes in flight: docs/explanation/filter.md. */

#ifndef NAMED_NAVIGATION_H
#define NAMED_NAVIGATION_H

#include "../filter/filter_state.h"

/* Navigation in use: what is not named. */
void filter_leave_out_named(Filter *filter);

/* What is held against it after the sample of a solution; residual gets the distances of what was named from its
   prediction. */
void filter_judge(Filter *filter, double residual[N_NAVIGATION]);

/* What was held before. */
void filter_keep_named(Filter *filter);

#endif
