/* The records of a tare: what it is given, and what it found.

   Limits: dynamic_pressure [Pa], zero, drift; then (n_gauges) known_strain and known_strain_std. The outcome:
   (n_gauges) zero, zero_std, one zero_common_std, (n_gauges) whether a gauge reads, scatter; then the flags and the
   verdict, in the order of TareFlags and TareVerdict. */

#ifndef TARE_RECORD_H
#define TARE_RECORD_H

#include "../zeros/tare.h"

enum { N_TARE_LIMITS = 3, N_TARE_VERDICT = sizeof(TareVerdict) / sizeof(double) };

/* Names of the fields of one value each. */
extern const char *const TARE_LIMIT_NAMES[N_TARE_LIMITS];
extern const char *const TARE_VERDICT_NAMES[N_TARE_VERDICT];

/* Judge by `limits` from now on, which must live as long as that; by the limits of `of_map` if they are NULL. */
void use_limits(Tare *tare, const TareLimits *of_map, const double *limits);

/* Write the outcome of which the zeros (2 n_gauges + 1) are `zero`. */
void write_tare(const Tare *tare, const double *zero, double *outcome);

#endif
