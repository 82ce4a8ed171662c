#include "filter_map.h"

#include <float.h>

#define LARGEST_NUMBER 64 /* of directions and terms */
#define MOST_COLUMNS 4096 /* of section loads, of temperature modes and with them of errors in common */

static void take_numbers(MapFile *file, FilterMap *map) {
    map_positives(file, "filter.rate", N_STATES);
    map_copy(file, "filter.rate", N_STATES, map->rate);
    map->rate_time = map_between(file, "filter.rate_time", 0.0, DBL_MAX);
    map->slow = map_positive(file, "filter.slow");
    map->white_navigation = map_between(file, "filter.white_navigation", DBL_MIN, 1.0);
    map->window = map_between(file, "filter.window", 1.0, DBL_MAX);
    map->band = map_positive(file, "filter.band");
    map->widen = map_between(file, "filter.widen", 1.0, DBL_MAX);
    map->narrow = map_between(file, "filter.narrow", DBL_MIN, 1.0);
    map->largest_widening = map_between(file, "filter.largest_widening", 1.0, DBL_MAX);
    map->smallest_time = map_positive(file, "filter.smallest_time");
    map->largest_time = map_positive(file, "filter.largest_time");
    map->named_after = map_between(file, "filter.named_after", 1.0, DBL_MAX);
    map->fits = map_positive(file, "filter.fits");
    map->slope_time = map_positive(file, "filter.slope_time");
    map->of_age = map_positive(file, "filter.of_age");
    map->longest_step = map_positive(file, "filter.longest_step");
    map_require(file, map->largest_time > map->smallest_time, "filter.largest_time", "a number above the smallest time");
}

int filter_map_parse(MapFile *file, size_t n_gauges, FilterMap *map) {
    const size_t n = n_gauges;
    map->n_seen = map_length(file, "filter.seen_strain", 0, 0, LARGEST_NUMBER);
    map->n_shared = map_length(file, "filter.shared", 0, 0, MOST_COLUMNS);
    map->n_terms = map_length(file, "filter.of_gauge", 0, 0, LARGEST_NUMBER);
    map->n_own = map_length(file, "filter.own", 0, 0, 1);
    map->n_other = map_length(file, "filter.other_load", 0, 0, MOST_COLUMNS);
    map->n_modes = map_count(file, "filter.n_modes", 0, map->n_shared);
    take_numbers(file, map);
    map->seen_strain = map_doubles(file, "filter.seen_strain", map->n_seen, n);
    map->seen_load = map_doubles(file, "filter.seen_load", map->n_seen, N_LOADS);
    map->rest_strain = map_doubles(file, "filter.rest_strain", n, n);
    map->rest_load = map_doubles(file, "filter.rest_load", N_LOADS, N_LOADS);
    map->rest_cross = map_doubles(file, "filter.rest_cross", N_LOADS, n);
    map->noise = map_covariance(file, "filter.noise", n);
    map->shared = map_doubles(file, "filter.shared", map->n_shared, n);
    map->of_gauge = map_doubles(file, "filter.of_gauge", map->n_terms, 1 + N_LOADS, n);
    map->own = map_doubles(file, "filter.own", map->n_own, n);
    map->other_load = map_doubles(file, "filter.other_load", map->n_other, map->n_seen);
    map->other_cross = map_doubles(file, "filter.other_cross", map->n_other, n);
    map->other_variance = map_doubles(file, "filter.other_variance", map->n_other);
    return file->good;
}
