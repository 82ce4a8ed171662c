/* How consistent the filter's innovations are, which widens the discrepancy: docs/explanation/filter.md. */

#ifndef CONSISTENCY_H
#define CONSISTENCY_H

#include "../filter/filter_state.h"

/* One more normalised innovation, of so many degrees of freedom. */
void filter_note(Filter *filter, double chi_square, double degrees_of_freedom);

#endif
