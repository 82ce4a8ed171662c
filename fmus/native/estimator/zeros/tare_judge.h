/* The zeros that a window of readings gives, and what speaks against them.

   Zero: mean over the window, less what the known loads strain. Its standard deviation is as of a mean of n readings,
   s / sqrt(n) for independent ones. Readings of filtered or slow channels are not independent: the means of B stretches
   (tare_window.h) scatter by more than s / sqrt(n / B). The factor on the variance is averaged over all gauges, as the
   channels have their filters in common; a gauge with far more has its own. It falls short by a term in proportion to
   B, which two numbers of stretches determine (batch means: Alexopoulos and Seila, Handbook of Simulation, 1998, ch. 7).
   What the means of all gauges have in common is their common error. */

#ifndef TARE_JUDGE_H
#define TARE_JUDGE_H

#include "tare_state.h"

/* Number of doubles of its scratch. */
size_t judge_doubles(size_t n_gauges, size_t n_patterns);

/* Set tare->judged and tare->verdict from tare->statistics; all that speaks against the zeros is in the verdict. A gauge
   that does not read gets 0 with the largest standard deviation there is. */
void tare_judge(Tare *tare);

#endif
