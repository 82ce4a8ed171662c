#include "linear_filter_map.h"

#include <math.h>
#include <stdio.h>

#define N_FILTER_SIZES 8
#define N_FILTER_SCALARS 3
#define LARGEST_NUMBER 4096

enum { N_SCALED, N_COMMON, N_OWN, N_REST, N_MODES, N_NUMBERS };

static size_t number_of_doubles(const LinearFilterMap *map, size_t n) {
    const size_t loads = N_LOADS, states = map->n_scaled + map->n_common;
    return N_FILTER_SCALARS + states + map->n_scaled * (n + loads) + (map->n_common + map->n_own + map->n_rest) * n + n
         + loads * n;
}

static int sensible_values(const LinearFilterMap *map, const double *values, size_t count, size_t n) {
    int good = 1;
    for (size_t i = 0; i < count; i++) {
        good = good && isfinite(values[i]);
    }
    for (size_t k = 0; k < map->n_scaled + map->n_common; k++) {
        good = good && map->std[k] > 0.0;
    }
    for (size_t g = 0; g < n; g++) {
        good = good && map->noise[g] > 0.0;
    }
    return good && map->slow > 0.0 && map->smallest_time > 0.0 && map->largest_time > map->smallest_time;
}

int linear_filter_map_parse(const Section *section, size_t n_gauges, LinearFilterMap *map, char text[MODEL_TEXT_SIZE]) {
    const unsigned char *content = section->content;
    size_t *const size[N_NUMBERS] = {&map->n_scaled, &map->n_common, &map->n_own, &map->n_rest, &map->n_modes};
    int good = section->length >= 4 * N_FILTER_SIZES;
    for (size_t k = 0; good && k < N_NUMBERS; k++) {
        *size[k] = u32_at(content, 4 * k);
        good = *size[k] <= LARGEST_NUMBER;
    }
    good = good && map->n_scaled > 0 && map->n_modes <= map->n_common
        && section->length == 4 * N_FILTER_SIZES + 8 * number_of_doubles(map, n_gauges);
    if (!good) {
        snprintf(text, MODEL_TEXT_SIZE, "holds a filter whose sizes cannot be");
        return 0;
    }
    const double *values = (const double *)(const void *)(content + 4 * N_FILTER_SIZES), *next = values;
    map->slow = *take_doubles(&next, 1);
    map->smallest_time = *take_doubles(&next, 1);
    map->largest_time = *take_doubles(&next, 1);
    map->std = take_doubles(&next, map->n_scaled + map->n_common);
    map->scaled = take_doubles(&next, map->n_scaled * n_gauges);
    map->load = take_doubles(&next, map->n_scaled * N_LOADS);
    map->common = take_doubles(&next, map->n_common * n_gauges);
    map->own = take_doubles(&next, map->n_own * n_gauges);
    map->rest = take_doubles(&next, map->n_rest * n_gauges);
    map->noise = take_doubles(&next, n_gauges);
    map->rest_cross = take_doubles(&next, N_LOADS * n_gauges);
    if (!sensible_values(map, values, number_of_doubles(map, n_gauges), n_gauges)) {
        snprintf(text, MODEL_TEXT_SIZE, "holds a filter with a value that cannot be");
        return 0;
    }
    return 1;
}
