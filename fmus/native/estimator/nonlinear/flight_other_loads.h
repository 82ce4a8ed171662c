/* Loads in addition to the five over the flight state, part "flight_loads" of resources/map.bin. */

#ifndef FLIGHT_OTHER_H
#define FLIGHT_OTHER_H

#include "../sample/inputs.h"
#include "../update/other_loads.h"
#include "flight_solver.h"

typedef struct {
    TableMap tables;                 /* a row per load, on the knots of the tables of strain; no rows in maps without */
    MAP_MEMBERS(FLIGHT_LOADS)
} FlightOtherLoadsMap;

typedef struct {
    FlightOtherLoadsMap map;
    FlightTables tables;
    Response response;
    double *turned; /* (n_loads, n) L^-1 of strain_covariance, n_gauges in lanes */
    double *full_turned; /* (n_loads, n) the same of the full model */
    double *others; /* (MOST_OTHERS, n_loads) of the tables at other solutions */
} FlightOtherLoads;

/* Read the part of n_loads loads in addition to the tables of `flight`. 1; 0 with a text. */
int flight_other_loads_parse(MapFile *file, const FlightMap *flight, size_t n_loads, FlightOtherLoadsMap *map);

/* Hand out the arrays, filled in. */
void flight_other_loads_arrays(FlightOtherLoads *other_loads, size_t n_gauges, Room *room);

/* Set out->value for the solution, at the references of the settings. */
void flight_other_loads_at(FlightOtherLoads *other_loads, const FlightSolver *solver, const Inputs *inputs, OtherLoads *out);

/* All of them are not known. */
void other_loads_unknown(OtherLoads *out);

#endif
