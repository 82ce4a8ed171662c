/* What noise that is independent from sample to sample adds to the errors of the linear estimator. */

#ifndef LINEAR_NOISE_H
#define LINEAR_NOISE_H

#include "linear_state.h"

/* Variances by gauge noise (n_gauges) and a part of the variance of q_inf: of the outputs of loads (5), of coefficients (5).
   scratch takes (5, linear_noise_row). */
size_t linear_noise_row(const Map *map);
void linear_noise(const Linear *linear, const double *gauge_noise, double of_pressure, double *scratch, double *of_loads,
                  double *of_coefficients);

/* The same of loads and coefficients (n_loads) in addition to the five, whose outputs are set. */
void linear_other_noise(const Linear *linear, const double *gauge_noise, double of_pressure, double *scratch,
                        double *of_loads, double *of_coefficients);

#endif
