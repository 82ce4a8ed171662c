/* The gauge that does not fit the others, for maps in form "dynamic_pressure": z = (P r)_i / sqrt(P_ii) at the present
   pressure ratio. */

#ifndef SCALED_SUSPECTS_H
#define SCALED_SUSPECTS_H

#include "../estimator.h"

/* As set_suspects. */
void set_scaled_suspects(Estimator *e, double threshold);

/* z (n_gauges) of the last step; 0 where no other gauge in use checks it, and left as it is of gauges not in use. */
void scaled_standardised_residuals(Estimator *e, double *z);

#endif
