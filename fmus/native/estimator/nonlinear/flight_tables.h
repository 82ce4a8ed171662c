/* Strain and loads over the flight state, as strainfmu/estimator/map/flight_tables.py has them.

   Rows are strains, then the five loads; or the other loads. Tables are laid out for registers: harmonics of a channel in multiples of
   LANES; every sum runs in LANES parts, which are added in one order on every processor. */

#ifndef FLIGHT_TABLES_H
#define FLIGHT_TABLES_H

#include "../map/flight_map.h"
#include "../numerics/lanes.h"

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

#define DEGREE 3 /* of the splines */
#define N_LOCAL (DEGREE + 1)

/* The basis functions that are not zero at a point, and their derivatives. */
typedef struct {
    size_t first;
    double value[N_LOCAL], slope[N_LOCAL];
} Basis;

/* The basis at x; beyond the outer knots splines go on along their tangent. */
Basis flight_basis(const double *knots, size_t n, double x);

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

/* Make the cells that are read from the pairs of knots `mach` and `incidence` on. */
void flight_make_cells(const FlightTables *tables, size_t mach, size_t incidence);

/* The response at a state, kept where it is there already: a step starts where the one before ended. wide as for
   wide.h. */
void flight_response(const FlightTables *tables, int wide, const double *state, Response *response);

#endif
