#include "linear_filter_map.h"

#define LARGEST_NUMBER 4096

int linear_filter_map_parse(MapFile *file, size_t n_gauges, LinearFilterMap *map) {
    const size_t n = n_gauges;
    map->n_scaled = map_length(file, "linear_filter.scaled", 0, 1, LARGEST_NUMBER);
    map->n_common = map_length(file, "linear_filter.common", 0, 0, LARGEST_NUMBER);
    map->n_own = map_length(file, "linear_filter.own", 0, 0, LARGEST_NUMBER);
    map->n_rest = map_length(file, "linear_filter.rest", 0, 0, LARGEST_NUMBER);
    map->n_modes = map_count(file, "linear_filter.n_modes", 0, map->n_common);
    map->slow = map_positive(file, "linear_filter.slow");
    map->smallest_time = map_positive(file, "linear_filter.smallest_time");
    map->largest_time = map_positive(file, "linear_filter.largest_time");
    map->std = map_positives(file, "linear_filter.std", map->n_scaled + map->n_common);
    map->scaled = map_doubles(file, "linear_filter.scaled", map->n_scaled, n);
    map->load = map_doubles(file, "linear_filter.load", map->n_scaled, N_LOADS);
    map->common = map_doubles(file, "linear_filter.common", map->n_common, n);
    map->own = map_doubles(file, "linear_filter.own", map->n_own, n);
    map->rest = map_doubles(file, "linear_filter.rest", map->n_rest, n);
    map->noise = map_positives(file, "linear_filter.noise", n);
    map->rest_cross = map_doubles(file, "linear_filter.rest_cross", N_LOADS, n);
    return map_require(file, map->largest_time > map->smallest_time, "linear_filter.largest_time",
                       "a number above the smallest time");
}
