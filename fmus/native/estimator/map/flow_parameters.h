/* Parameters of the flow: their ranges, which the estimate does not use, and health does.

   strainfmu/estimator/map/flow_parameters.py in C; they are part
   "parameters" of resources/map.bin. */

#ifndef FLOW_PARAMETERS_H
#define FLOW_PARAMETERS_H

#include "container.h"

#define PARAMETER_NAME_SIZE 48 /* bytes of a name in the file, with its final zero */

/* Arrays point into the bytes of the file. */
typedef struct {
    MAP_MEMBERS(PARAMETERS) /* count: 0 in maps without */
} FlowParameters;

/* Read the part, if there is one. 1; 0 after a message. */
int flow_parameters_parse(MapFile *file, FlowParameters *parameters);

/* Part of its range by which parameter `which` leaves it at a value, 0 inside and for NaN. */
double parameter_score(const FlowParameters *parameters, size_t which, double value);

/* The first of the parameters that leaves its range; SIZE_MAX for none. Those that are not_known do not. */
size_t parameter_outside(const FlowParameters *parameters, const double *value, double not_known);

#endif
