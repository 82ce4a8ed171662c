/* The outputs by the filter: what its channels are, and where filtered values go. Of linear maps, too: `flight` knows the
   linear estimator, inputs and outputs of every map. */

#ifndef FILTERED_OUTPUTS_H
#define FILTERED_OUTPUTS_H

#include "../filter/filter.h"
#include "flight_outputs.h"

/* Read the filter's part and allocate, after all other parts. 1; 0 after a message. */
int filtered_outputs_create(MapFile *file, const Flight *flight, Filter *filter);

/* Filter the outputs, which are of the sample alone, by windows of at most a time [s]. */
void filtered_outputs(Filter *filter, Flight *flight, double time_constant);

#endif
