/* The linear estimator: outputs of a sample, and the conditions that its health follows from. */

#ifndef LINEAR_H
#define LINEAR_H

#include "linear_outputs.h"

/* Hand out the arrays; map, other_loads and wide are set. */
void linear_arrays(Map *map, size_t n_strains, Linear *linear, Room *room);

/* Give the map its matrices. 0 if the covariance of its gauges is none. */
int linear_begin(Linear *linear);

/* After the last prepared_part: the map has other matrices, and what follows from them. */
void linear_renewed(Linear *linear);

/* Set all outputs but health for the present inputs, and linear->conditions. */
void linear_update(Linear *linear);

/* Write loads and coefficients at a dynamic pressure and its standard deviation to the outputs. 1; 0, and they keep
   their values, if the map has none. */
int linear_loads_at(Linear *linear, double dynamic_pressure, double deviation);

#endif
