/* The gauge that does not fit the others, for maps in form "dynamic_pressure": z = (P r)_i / sqrt(P_ii) at the present
   pressure ratio. */

#ifndef SCALED_SUSPECTS_H
#define SCALED_SUSPECTS_H

#include "linear_state.h"

/* As set_suspects. */
void set_scaled_suspects(Linear *linear, double threshold);

#endif
