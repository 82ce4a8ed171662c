/* Products of a set of gauges at fixed levels of the pressure ratio, computed when a step first needs them.

   The C counterpart of level_products in strainfmu/estimator/map/proportional_errors.py. */

#ifndef ERROR_LEVELS_H
#define ERROR_LEVELS_H

#include "../estimator.h"

/* The levels below and above a ratio > 0: powers of 2, and those times sqrt(1/2). */
void enclosing_levels(double ratio, double *below, double *above);

/* The products for the gauges in use at a level, from those that are kept if they are there; `other` stays. */
const Level *error_level(Estimator *e, double ratio, const Level *other);

/* (21, n_loads) the same products for the further loads of the map. */
void further_level(Estimator *e, double ratio, double *products);

#endif
