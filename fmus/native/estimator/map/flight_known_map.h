/* Part "parameter_tables" of resources/map.bin: what each other parameter of the flow changes of strain and loads over
   the flight state, and errors. strainfmu/estimator/tables/parameter_factors.py has the formulas. */

#ifndef FLIGHT_KNOWN_MAP_H
#define FLIGHT_KNOWN_MAP_H

#include "flight_map.h"
#include "map_resource.h"

/* Arrays point into the bytes of the file. */
typedef struct {
    size_t n_rows, n_other; /* of strains, loads and other loads; of these the last */
    MAP_MEMBERS(PARAMETER_TABLES)
    MAP_MEMBERS(PRODUCTS)
} KnownMap;

/* Read the part in addition to the tables of strain. 1; 0 with a text. */
int known_map_parse(MapFile *file, const FlightMap *flight, size_t n_gauges, size_t n_other, KnownMap *map);

/* Products of strain, of loads with strain, of loads, of other loads with strain; variances of other loads. */
size_t known_product_size(const KnownMap *map, size_t n_gauges);

#endif
