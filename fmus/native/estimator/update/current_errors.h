/* Errors in proportion to strain, at the current one (eq:proportional): what they add to the covariance of the loads and to
   the expected chi-square, G D G' and the trace of P D. */

#ifndef CURRENT_ERRORS_H
#define CURRENT_ERRORS_H

#include "lost_rows.h"

/* Hand out the arrays. */
void current_errors_arrays(Scaled *scaled, Room *room);

/* Fill in the tables of a map, and forget all intervals. */
void current_errors_prepare(Scaled *scaled);

/* The interval of a ratio > 0, from those that are kept if it is there. */
const Interval *current_interval(Scaled *scaled, double ratio);

/* Upper bounds of |V_i|^2 / P_ii of gauges that others check, 0 of others, whose z is 0: the ends of the interval bound
   P_ii of all gauges, from which the lost ones take their part. 0 where these leave it open whether others check a gauge. */
int current_errors_set_bound(const Scaled *scaled, const Interval *interval, size_t n_lost, double *bound);

/* step->powers: products of the coefficients of the loads less their mean, times powers of the ratio in its interval. */
void current_errors_set_powers(Scaled *scaled);

/* The gain of the gauges in use, and what errors in common make of it and of Y: where the lost gauges or the ratio change,
   after lost_rows_prepare. */
void current_errors_take_lost(Scaled *scaled);

/* The covariance (5, 5) of the loads, with them added to `base`; the trace of P D at a ratio of 1. */
double current_errors_add(Scaled *scaled, const double *base, double *covariance);

/* What they add to the variance of other load j. */
double current_errors_of_other(const Scaled *scaled, size_t j);

#endif
