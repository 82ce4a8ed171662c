/* The gauge that does not fit the others: z of each is its difference from what the others predict for it, in standard
   deviations. z = (P r)_i / sqrt(P_ii) at the present pressure ratio; strainfmu/estimator/alarm_limits.py has its
   thresholds. */

#ifndef SUSPECTS_H
#define SUSPECTS_H

#include "linear_state.h"

/* If some |z| is above the threshold, set the outputs SUSPECT_GAUGE and SUSPECTS: the gauge of the
   largest |z|, and the number of those from which it cannot be distinguished. The step, CHI_SQUARE
   and its limit must be set. */
void set_suspects(Linear *linear, double threshold);

#endif
