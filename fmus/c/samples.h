/* A short flight that the map covers, in which one gauge fails, and what strainfmu computes of it.

   For example.c and measure.c; a flight program needs neither. */

#ifndef SAMPLES_H
#define SAMPLES_H

#include <stddef.h>

extern const size_t sl_sample_count;
extern const double sl_sample_time[];   /* (sl_sample_count) [s] */
extern const double sl_sample_input[];  /* (sl_sample_count, SL_INPUTS) */
extern const double sl_sample_output[]; /* (sl_sample_count, SL_OUTPUTS) of sl_step, one sample after another */

#endif
