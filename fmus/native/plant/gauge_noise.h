/* Gauge noise: a standard normal number for every seed, sample and gauge, the same on every platform.

   strainfmu/cosim/models/gauge_noise.py holds the same in numpy, and the table. */

#ifndef GAUGE_NOISE_H
#define GAUGE_NOISE_H

#include <stddef.h>
#include <stdint.h>

#define NOISE_OCTAVES 53
#define NOISE_COEFFICIENTS 10
#define NOISE_TABLE_SIZE (NOISE_OCTAVES * NOISE_COEFFICIENTS)

double gauge_noise(const double *table, uint64_t seed, uint64_t sample, uint64_t gauge);

#endif
