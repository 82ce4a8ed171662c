/* The step of a map in form "dynamic_pressure": weights follow the dynamic pressure, errors the current strain.

   The C counterpart of strainfmu/estimator/linear/pressure_weights.py and loads_from_strain.py, where the formulas are. */

#ifndef SCALED_FORM_H
#define SCALED_FORM_H

#include "../estimator.h"

/* Number of doubles and of indices that the arrays of such an estimator take, and handing them out. */
size_t scaled_doubles(const Map *map);
size_t scaled_indices(const Map *map);
void scaled_arrays(Estimator *e, double **doubles, size_t **indices);

/* Fill in the tables, once. */
void scaled_prepare(Estimator *e);

/* Forget the levels of the set of gauges in e->cache[k]. */
void scaled_forget(Estimator *e, int k);

/* A symmetric (5, 5) matrix of its 15 entries, row by row from the diagonal. */
void set_symmetric(const double *entries, double *matrix);

/* Set all outputs but the number of gauges and the health, where the gauges in use identify the state and the dynamic
   pressure is known. */
void scaled_update(Estimator *e);

/* Along a change of the pressure ratio, that of u of direction a. */
double scaled_unresolved_change(const Estimator *e, size_t a, double ds);

/* Changes of pressure ratio, q_inf and loads about the map's moment point; those of w and of the mean's are in
   step->scratch. */
typedef struct {
    double ds, pressure, loads[N_LOADS];
} ScaledChange;

/* Derivatives of rolling moment and section loads then, as estimator->further has them. */
void further_derivative(Estimator *e, const double *d_scalar, const ScaledChange *change, double *d_further);

/* Add the derivatives of the outputs along d_input to d_output, which is zero. */
void scaled_derivative(Estimator *e, const double *d_input, double *d_output);

#endif
