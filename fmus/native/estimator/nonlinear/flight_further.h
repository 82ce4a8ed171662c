/* Further loads over the flight state: rolling moment and loads of sections by the nonlinear estimator.

   The equations are those of strainfmu/estimator/reference/nonlinear.py. They are part
   "flight_loads" of resources/map.bin. Of strain off the tables they are those of
   further_loads.h. */

#ifndef FLIGHT_FURTHER_H
#define FLIGHT_FURTHER_H

#include "../sample/inputs.h"
#include "../update/further_loads.h"
#include "solver_state.h"

typedef struct {
    TableMap tables;                 /* a row per load, on the knots of those of strain; no rows in maps without */
    const double *strain_covariance; /* (n_loads, n_gauges) per p_inf^2 */
    const double *variance;          /* (n_loads) per p_inf^2 */
} FlightFurtherMap;

typedef struct {
    FlightFurtherMap map;
    FlightTables tables;
    Response response;
    double *turned; /* (n_loads, n) L^-1 of strain_covariance, n_gauges in lanes */
} FlightFurther;

/* Read the part of n_loads loads beside the tables of `flight`. 1; 0 with a text. */
int flight_further_parse(MapFile *file, const FlightMap *flight, size_t n_gauges, size_t n_loads, FlightFurtherMap *map);

/* Number of doubles that the arrays take, and handing them out, filled in. */
size_t flight_further_doubles(const FlightFurtherMap *map, size_t n_gauges);
void flight_further_arrays(FlightFurther *further, size_t n_gauges, double **doubles);

/* Set out->value for the solution, at the references of the settings. */
void flight_further_loads(FlightFurther *further, const FlightSolver *solver, const Inputs *inputs, Further *out);

/* All of them are not known. */
void further_unknown(Further *out);

#endif
