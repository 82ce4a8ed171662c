/* What noise that is independent from sample to sample adds to the errors of the nonlinear estimator, and how these grow
   where the flight state moves unseen. */

#ifndef FLIGHT_NOISE_H
#define FLIGHT_NOISE_H

#include "flight_other_loads.h"

/* Responses of the solution to what is read: rows (N_ROWS, n + LANES) of the flight state, five loads, five coefficients at
   the references of the map, each in standard deviations of the noise of gauges, then of air data. */
#define N_NOISE_ROWS (N_STATES + 2 * N_LOADS)
size_t flight_noise_row(size_t n_gauges);

/* Set them for gauges with these variances of noise (n_gauges), and the part of the variance of air data that is noise; of
   the last solution. rows take another (N_STATES + N_LOADS) of them as scratch. */
void flight_noise_rows(const FlightSolver *solver, const double *gauge_noise, double of_air, double *rows);

/* Variances of loads and coefficients (n_loads) in addition to the five, whose outputs are set; scratch takes two rows. */
void flight_other_noise(FlightOtherLoads *other_loads, const FlightSolver *solver, const Inputs *inputs,
                        const OtherLoads *out, const double *gauge_noise, const double *rows, double *scratch,
                        double *of_loads, double *of_coefficients);

#endif
