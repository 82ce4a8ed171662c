/* Temperature modes in the filter: docs/explanation/filter.md. Their states are the last that a sample reads. */

#ifndef FILTER_MODES_H
#define FILTER_MODES_H

#include "filter_state.h"

/* Their covariance by the sensors that read, in filter->stationary. */
void filter_set_modes(Filter *filter);

/* What is known of them, to a law that is of the sample. */
void filter_tell_modes(const Filter *filter, Law *law);

/* The first of their states. */
size_t filter_first_mode(const Filter *filter);

/* The predicted mean and covariance, of which the other states' are set; amplitudes stay where other sensors read than in
   the last sample. */
void filter_carry_modes(const Filter *filter, Law *out);
void filter_forget_modes(const Filter *filter, double factor, double *covariance);

#endif
