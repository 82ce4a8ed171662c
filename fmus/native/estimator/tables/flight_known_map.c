#include "flight_known_map.h"

#include <math.h>
#include <stdio.h>

#define N_KNOWN_SIZES 8
#define MAX_PARAMETERS 64
#define MAX_BASIS 65536
#define MAX_POWER 3

enum { N_PARAMETERS, N_POWERS, N_BASIS, N_FURTHER_ROWS };

size_t known_product_size(const KnownMap *map, size_t n) {
    const size_t loads = N_LOADS, m = map->n_further;
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

static size_t basis_doubles(const KnownMap *map, const TableMap *tables) {
    return map->n_basis * (tables->n_incidence + 2) * tables->n_harmonics * 2;
}

static size_t weight_doubles(const KnownMap *map, const TableMap *tables) {
    return (tables->n_mach + 2) * map->n_powers * map->n_rows * map->n_basis;
}

/* But for the products. */
static size_t leading_doubles(const KnownMap *map, const TableMap *tables) {
    return 1 + 2 * map->n_parameters + 3 * map->n_powers + basis_doubles(map, tables) + weight_doubles(map, tables);
}

static void take_values(KnownMap *map, const TableMap *tables, const double **next) {
    map->largest_score = *take_doubles(next, 1);
    map->mean = take_doubles(next, map->n_parameters);
    map->spread = take_doubles(next, map->n_parameters);
    map->parameter = take_doubles(next, map->n_powers);
    map->power = take_doubles(next, map->n_powers);
    map->offset = take_doubles(next, map->n_powers);
    map->basis = take_doubles(next, basis_doubles(map, tables));
    map->row_weight = take_doubles(next, weight_doubles(map, tables));
    map->product = *next;
}

static int sensible_values(const KnownMap *map, const double *values, size_t count) {
    int good = map->largest_score >= 0.0;
    for (size_t i = 0; i < count; i++) {
        good = good && isfinite(values[i]);
    }
    for (size_t p = 0; p < map->n_parameters; p++) {
        good = good && map->spread[p] >= 0.0;
    }
    for (size_t j = 0; j < map->n_powers; j++) {
        const double parameter = map->parameter[j], power = map->power[j];
        good = good && parameter >= (j > 0 ? map->parameter[j - 1] : 0.0) && parameter < (double)map->n_parameters
            && parameter == (double)(size_t)parameter && (power == 1.0 || power == 2.0 || power == MAX_POWER);
    }
    return good;
}

/* The sizes; 0 where they cannot be. */
static int take_sizes(const Section *section, const TableMap *tables, size_t n_further, KnownMap *map) {
    if (section->length < 4 * N_KNOWN_SIZES) {
        return 0;
    }
    map->n_parameters = u32_at(section->content, 4 * N_PARAMETERS);
    map->n_powers = u32_at(section->content, 4 * N_POWERS);
    map->n_basis = u32_at(section->content, 4 * N_BASIS);
    map->n_further = n_further;
    map->n_rows = tables->n_rows + n_further;
    return map->n_parameters >= 1 && map->n_parameters <= MAX_PARAMETERS
        && map->n_powers <= MAX_POWER * map->n_parameters && map->n_basis <= MAX_BASIS
        && u32_at(section->content, 4 * N_FURTHER_ROWS) == n_further;
}

int known_map_parse(const Section *section, const FlightMap *flight, size_t n_gauges, size_t n_further, KnownMap *map,
                    char text[MODEL_TEXT_SIZE]) {
    const size_t values_at = 4 * N_KNOWN_SIZES;
    const TableMap *tables = &flight->tables;
    int good = take_sizes(section, tables, n_further, map);
    if (good && section->length >= values_at + 8 * leading_doubles(map, tables)) {
        const double *values = (const double *)(const void *)(section->content + values_at), *next = values;
        take_values(map, tables, &next);
        const size_t count = leading_doubles(map, tables) + number_of_products(map) * known_product_size(map, n_gauges);
        good = section->length == values_at + 8 * count;
        if (good && !sensible_values(map, values, count)) {
            snprintf(text, MODEL_TEXT_SIZE, "holds tables of known parameters with a value that cannot be");
            return 0;
        }
    } else {
        good = 0;
    }
    if (!good) {
        snprintf(text, MODEL_TEXT_SIZE, "holds tables of known parameters whose sizes cannot be");
    }
    return good;
}
