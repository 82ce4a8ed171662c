/* Second derivatives of strain and loads by the flight state, for the derivatives of the estimates. */

#ifndef FLIGHT_CURVATURE_H
#define FLIGHT_CURVATURE_H

#include "flight_tables.h"

#define N_CURVED 6 /* pairs of M, u, w; those with ln p_inf are first derivatives */

typedef struct {
    double *value[N_CURVED];     /* (rows) MM, Mu, Mw, uu, uw, ww */
    double *amplitude[N_CURVED]; /* (width) scratch: value; by M, incidence; by MM, M incidence, incidence twice */
    double *wind[2 * N_CURVED];  /* (harmonics) scratch: cos, sin of m phi_T; by u; by w; by uu; by uw; by ww */
} Curvature;

/* Number of doubles, and handing them out. */
size_t curvature_doubles(const TableMap *map);
void curvature_arrays(const FlightTables *tables, Curvature *curvature, double **doubles);

/* The second derivatives at a state. */
void flight_curvature(const FlightTables *tables, const double *state, Curvature *curvature);

/* The derivatives of all rows by the states k and l; jacobian (N_STATES) are the first ones of the same state. */
const double *second_derivative(const Curvature *curvature, double *const *jacobian, size_t k, size_t l);

#endif
