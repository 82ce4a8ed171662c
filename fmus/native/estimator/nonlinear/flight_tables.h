/* Strain and loads over the flight state, as strainfmu/estimator/map/flight_tables.py has them. Rows are strains, then the five
   loads; or the other loads. */

#ifndef FLIGHT_TABLES_H
#define FLIGHT_TABLES_H

#include "../map/map_resource.h"
#include "../numerics/wide.h"

/* What cells are made of, each when it is first read in a round: a first part and the others times a weight. */
typedef struct {
    size_t n_weights, n_cells;
    const double *part;   /* (1 + n_weights, n_cells, width) */
    double *weight;       /* (n_weights) */
    double *made;         /* (n_cells) the round that each is of */
    double round;         /* whole number, from 1 on; another one makes all of them again */
} CellParts;

typedef struct {
    const TableMap *map;
    const CellParts *parts; /* of the cells; NULL where they are all there */
    size_t harmonics;       /* n_harmonics in lanes */
    size_t width;           /* of the coefficients at a pair of knots */
    double *cells;          /* (n_mach + 2, n_incidence + 2, width) */
    double *cosine, *sine;  /* (n_terms, harmonics) */
    double *amplitude[3];   /* (width) scratch: value, derivatives by M and incidence */
    double *wind[6];        /* (harmonics) scratch: cos and sin of m phi_T, derivatives by u, by w */
} FlightTables;

/* Response at a flight state, of the same tables always. */
typedef struct {
    int known;                  /* whether there is one yet */
    double state[N_STATES];     /* that it belongs to */
    double pressure;            /* p_inf [Pa] */
    double *value;              /* (rows) */
    double *jacobian[N_STATES]; /* (rows) */
} Response;

/* Number of doubles of the coefficients at all pairs of knots. */
size_t flight_cell_doubles(const TableMap *map);

/* Hand out the arrays of tables, filled in, and of a response. */
void flight_tables_arrays(const TableMap *map, FlightTables *tables, Room *room);
void response_arrays(const TableMap *map, Response *response, Room *room);

/* The response at a state, kept where it is there already: a step starts where the one before ended. wide as for
   wide.h. */
void flight_response(const FlightTables *tables, int wide, const double *state, Response *response);

#endif
