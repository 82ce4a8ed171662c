/* The tables over the flight state, part "flight" of resources/map.bin. strainfmu/estimator/resource/compact_tables.py has
   the formulas. */

#ifndef FLIGHT_MAP_H
#define FLIGHT_MAP_H

#include "container.h"

#define N_STATES 4     /* of the flight state: M [1], u, w [rad], ln(p_inf / Pa) */
#define N_NAVIGATION 3 /* M [1], p_inf [Pa], q_inf [Pa] */
#define MAX_SHAPES 16  /* discrepancy modes that are tested: the largest length of flight.shapes */
#define N_MEASURED 7   /* M, ln p_inf, ln q_inf of navigation; then the four priors */

enum { STATE_MACH, STATE_U, STATE_W, STATE_PRESSURE };

/* Tables of some rows; arrays point into the bytes of the file. A row is the sum of one term or two. */
typedef struct {
    size_t n_rows;
    MAP_MEMBERS(KNOTS)
    MAP_MEMBERS(TABLES)
} TableMap;

/* Quantities and units: strainfmu/estimator/map/nonlinear_map.py. */
typedef struct {
    TableMap tables;     /* of strains, then loads */
    TableMap considered; /* of strains, then all loads, of a considered error; no rows in maps without */
    int has_gain_error;  /* of any row's own */
    MAP_MEMBERS(FLIGHT)
} FlightMap;

/* Read tables of n_rows rows of a part, whose knots are known. 1; 0 with a text. */
int tables_parse(MapFile *file, const char *part, size_t n_rows, TableMap *tables);

/* Read the part of the considered error that has tables of strains and loads, after the part of the tables. 1; 0 with a
   text. */
int considered_parse(MapFile *file, size_t n_gauges, size_t n_loads, FlightMap *map);

/* Read the part for n_gauges gauges. 1; 0 with a text that states what is wrong. */
int flight_map_parse(MapFile *file, size_t n_gauges, FlightMap *map);

#endif
