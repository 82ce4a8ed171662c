/* Parameters of the flow that are known with a standard deviation: tables and errors about what is known of them. */

#ifndef FLIGHT_KNOWN_H
#define FLIGHT_KNOWN_H

#include "../sample/inputs.h"
#include "flight_loads.h"
#include "flight_solver.h"

/* Part "parameter_tables" of map.bin: tables and errors that follow known flow parameters, as sums over powers of
   each parameter.

   Powers are listed by ascending parameter, exponents 1 to 3. Tables of a power are sums over n_basis tables of
   incidence and harmonic, weighted by Mach knot and row. Products of errors, per p_inf^2, come in the order: of what
   no parameter makes; of each pair of powers a <= b of one parameter; of the spread of each parameter. Each product
   is a run of

       n n + 5 n + 25 + m n + m      strain; loads with strain; loads; m other loads with strain; variances of these

   numbers. Arrays point into the bytes of the file. */
typedef struct {
    size_t n_rows, n_other; /* of strains, loads and other loads; of these the last */
    MAP_MEMBERS(PARAMETER_TABLES)
    MAP_MEMBERS(PRODUCTS)
} KnownMap;

/* Tables, and products of their errors per p_inf^2. */
typedef struct {
    FlightTables tables, other_loads;
    double *scaled_covariance;       /* (n, n) in lanes */
    const double *load_strain_covariance, *load_covariance;
    const double *other_strain_covariance, *other_variance;
} Errors;

/* Tables of two channels to a row, the factors of cos m phi_T and of sin m phi_T, made of parts. */
typedef struct {
    TableMap map;
    CellParts parts; /* of the mean, then of a unit of each power */
} MadeTables;

typedef struct {
    int present;  /* whether the map has such tables; if not, nothing else is set */
    int in_use;   /* whether the solver's tables are `own`; the mean's else */
    KnownMap map;
    FlightMap *flight;      /* whose tables and errors they replace, with the solver's */
    FlightSolver *solver;
    FlightOtherLoads *others;  /* and of loads in addition to the five */
    MadeTables tables, other_loads;
    Errors mean, own;
    double *value, *std;            /* (n_parameters) that `own` is for, NaN of what is not known, and of all at first */
    double *weight, *shift, *along; /* (n_parameters), (n_powers), (n_powers) scratch */
    double *products;               /* (known_product_size) of `own` */
} Known;

/* Read the part in addition to the tables of strain. 1; 0 with a text. */
int known_map_parse(MapFile *file, const FlightMap *flight, size_t n_gauges, size_t n_other, KnownMap *map);

/* Lay out tables about the mean's, with other loads or without; hand out the arrays, filled in, after the tables of solver
   and other loads. */
void known_lay_out(const TableMap *mean, const TableMap *others, Known *known);
void known_arrays(FlightMap *flight, FlightSolver *solver, FlightOtherLoads *others, Known *known, Room *room);

/* Set the solver's tables to the ones about what the inputs know, or to the mean's where they know nothing. */
void known_follow(Known *known, const Inputs *inputs);

/* Set them to the mean's. */
void known_forget(Known *known);

#endif
