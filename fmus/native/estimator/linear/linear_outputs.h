/* Loads, coefficients, limits and suspects of a step of a linear map. */

#ifndef LINEAR_OUTPUTS_H
#define LINEAR_OUTPUTS_H

#include "linear_state.h"

/* Condition the loads on the strains, and set all outputs but the number of gauges and the health, where the gauges in use
   identify the state; of form "dynamic_pressure" where q_inf is known. */
void linear_outputs(Linear *linear);

/* Set linear->other_loads->value for the last step. */
void linear_other_loads_update(Linear *linear);

/* Variances by gauge noise (n_gauges) and a part of the variance of q_inf: of the outputs of loads (5), of coefficients (5).
   scratch takes (5, linear_noise_row). */
size_t linear_noise_row(const Map *map);
void linear_noise(const Linear *linear, const double *gauge_noise, double of_pressure, double *scratch, double *of_loads,
                  double *of_coefficients);

/* The same of loads and coefficients (n_loads) in addition to the five, whose outputs are set. */
void linear_other_noise(const Linear *linear, const double *gauge_noise, double of_pressure, double *scratch,
                        double *of_loads, double *of_coefficients);

#endif
