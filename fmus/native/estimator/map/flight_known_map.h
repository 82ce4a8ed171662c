/* Part "parameter_tables" of resources/map.bin: what each other parameter of the flow changes of strain and loads over
   the flight state, and errors. strainfmu/estimator/tables/parameter_factors.py has the formulas. */

#ifndef FLIGHT_KNOWN_MAP_H
#define FLIGHT_KNOWN_MAP_H

#include "flight_map.h"
#include "map_resource.h"

/* Arrays point into the bytes of the file. */
typedef struct {
    size_t n_parameters, n_powers, n_basis;
    size_t n_rows, n_other;    /* of strains, loads and other loads; of these the last */
    double largest_score;        /* of a parameter's range by which it may leave it and still be used */
    const double *mean, *spread; /* (n_parameters) over the snapshots; a spread of 0 where they hold one value */
    const double *parameter, *power, *offset; /* (n_powers) ascending parameter, exponent, mean over the snapshots */
    const double *basis;         /* (n_basis, n_incidence + 2, n_harmonics, 2) tables, whose sums by */
    const double *row_weight;    /* (n_mach + 2, n_powers, n_rows, n_basis) are of a unit of a power, per p_inf */
    const double *product;       /* (number of products, known_product_size) of errors, per p_inf^2: of those that no
                                    parameter makes; of pairs of powers a <= b of each parameter, both ways; of the
                                    spread of each */
} KnownMap;

/* Read the part in addition to the tables of strain. 1; 0 with a text. */
int known_map_parse(MapFile *file, const FlightMap *flight, size_t n_gauges, size_t n_other, KnownMap *map);

/* Products of strain, of loads with strain, of loads, of other loads with strain; variances of other loads. */
size_t known_product_size(const KnownMap *map, size_t n_gauges);

#endif
