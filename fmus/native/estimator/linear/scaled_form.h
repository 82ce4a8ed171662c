/* The step of a map in form "dynamic_pressure": weights follow the dynamic pressure, errors the current strain.

   eq:scaled-model, eq:scaled-loads and eq:scaled-chi-square of the page on the theory; strainfmu/estimator/reference. */

#ifndef SCALED_FORM_H
#define SCALED_FORM_H

#include "../estimator.h"

/* Number of doubles, with so many further loads, and of indices that the arrays of such an estimator take, and handing
   them out. */
size_t scaled_doubles(const Map *map, size_t n_further);
size_t scaled_indices(const Map *map);
void scaled_arrays(Estimator *e, double **doubles, size_t **indices);

/* Fill in the tables, once. */
void scaled_prepare(Estimator *e);

/* Set all outputs but the number of gauges and the health, where the gauges in use identify the state and the dynamic
   pressure is known. */
void scaled_update(Estimator *e);

#endif
