/* Part "parameter_tables" of map.bin: tables and errors that follow known flow parameters, as sums over powers of
   each parameter.

   Powers are listed by ascending parameter, exponents 1 to 3. Tables of a power are sums over n_basis tables of
   incidence and harmonic, weighted by Mach knot and row. Products of errors, per p_inf^2, come in the order: of what
   no parameter makes; of each pair of powers a <= b of one parameter; of the spread of each parameter. Each product
   is a run of

       n n + 5 n + 25 + m n + m      strain; loads with strain; loads; m other loads with strain; variances of these

   numbers. docs/explanation/nonlinear_estimator.md, "Any shape"; nonlinear/flight_known.c uses them. */

#include "flight_known_map.h"

#define MAX_POWER 3

size_t known_product_size(const KnownMap *map, size_t n) {
    const size_t loads = N_LOADS, m = map->n_other;
    return n * n + loads * n + loads * loads + m * n + m;
}

/* Of powers of a parameter, pairs of these; map->parameter is known. */
static size_t number_of_products(const KnownMap *map) {
    size_t count = 1 + map->n_parameters;
    for (size_t a = 0; a < map->n_powers; a++) {
        for (size_t b = a; b < map->n_powers; b++) {
            count += map->parameter[a] == map->parameter[b];
        }
    }
    return count;
}

/* Of each power, by ascending parameters, its parameter and exponent. */
static int sensible_powers(const KnownMap *map) {
    int good = 1;
    for (size_t j = 0; j < map->n_powers; j++) {
        const double parameter = map->parameter[j], power = map->power[j];
        good = good && parameter >= (j > 0 ? map->parameter[j - 1] : 0.0) && parameter < (double)map->n_parameters
            && parameter == (double)(size_t)parameter && (power == 1.0 || power == 2.0 || power == MAX_POWER);
    }
    return good;
}

int known_map_parse(MapFile *file, const FlightMap *flight, size_t n_gauges, size_t n_other, KnownMap *map) {
    map->n_other = n_other;
    map->n_rows = file->length[SYM_ROWS] = flight->tables.n_rows + n_other;
    file->length[SYM_HARMONICS] = flight->tables.n_harmonics;
    MAP_READ(file, "parameter_tables", PARAMETER_TABLES, KnownMap, map);
    if (!file->good
        || !map_require(file, sensible_powers(map), "parameter_tables.parameter",
                        "parameters of the map, ascending, and powers to 3")) {
        return 0;
    }
    file->length[SYM_PRODUCTS] = number_of_products(map);
    file->length[SYM_PRODUCT_SIZE] = known_product_size(map, n_gauges);
    MAP_READ(file, "parameter_tables", PRODUCTS, KnownMap, map);
    return file->good;
}
