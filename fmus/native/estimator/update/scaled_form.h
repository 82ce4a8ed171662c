/* The step of a linear map: weights follow the dynamic pressure, errors the current strain. */

#ifndef SCALED_FORM_H
#define SCALED_FORM_H

#include "lost_rows.h"

/* Hand out the arrays. map, other_loads and wide are set. */
void scaled_arrays(Scaled *scaled, Room *room);

/* Fill in the tables: once, and again where the matrices of the map are others. */
void scaled_prepare(Scaled *scaled);

/* Condition the loads on the strains (n_gauges) of the gauges in use, which identify the state, at a dynamic pressure [Pa]:
   scaled->step. */
void scaled_condition(Scaled *scaled, const MaskedMap *masked, double pressure, const double *strain);

/* z (n_gauges) of the last step; 0 where no other gauge in use checks it, and left as it is of gauges not in use. */
void scaled_standardised_residuals(Scaled *scaled, double *z);

/* Of the last step: load j in addition to the five, its variance and derivative by q_inf. */
void scaled_other_load(const Scaled *scaled, size_t j, double *value, double *variance, double *per_pressure);

/* The gain (dense_rows(n_gauges)) by strain in the last step of load k, of the five and those in addition; its derivative by
   q_inf. */
double scaled_gain(const Scaled *scaled, size_t k, double *gain);

#endif
