#include "filter_map.h"

#include <math.h>
#include <stdio.h>

#define N_FILTER_SIZES 8
#define N_FILTER_SCALARS 19
#define LARGEST_NUMBER 64 /* of directions and terms */
#define MOST_COLUMNS 4096 /* of section loads, of temperature modes and with them of errors in common */

enum { N_SEEN, N_SHARED, N_TERMS, N_OWN, N_FURTHER_LOADS, N_OF_MODES };

static size_t number_of_doubles(const FilterMap *map, size_t n) {
    const size_t loads = N_LOADS;
    return N_FILTER_SCALARS + map->n_seen * (n + loads) + 2 * n * n + loads * (loads + n) + map->n_shared * n
         + map->n_terms * (1 + loads) * n + map->n_own * n + map->n_further * (map->n_seen + n + 1);
}

static void take_scalars(FilterMap *map, const double **next) {
    memcpy(map->rate, take_doubles(next, N_STATES), sizeof map->rate);
    map->rate_time = *take_doubles(next, 1);
    map->slow = *take_doubles(next, 1);
    map->white_navigation = *take_doubles(next, 1);
    map->window = *take_doubles(next, 1);
    map->band = *take_doubles(next, 1);
    map->widen = *take_doubles(next, 1);
    map->narrow = *take_doubles(next, 1);
    map->largest_widening = *take_doubles(next, 1);
    map->smallest_time = *take_doubles(next, 1);
    map->largest_time = *take_doubles(next, 1);
    map->named_after = *take_doubles(next, 1);
    map->fits = *take_doubles(next, 1);
    map->slope_time = *take_doubles(next, 1);
    map->of_age = *take_doubles(next, 1);
    map->longest_step = *take_doubles(next, 1);
}

static void take_arrays(FilterMap *map, const double **next, size_t n) {
    map->seen_strain = take_doubles(next, map->n_seen * n);
    map->seen_load = take_doubles(next, map->n_seen * N_LOADS);
    map->rest_strain = take_doubles(next, n * n);
    map->rest_load = take_doubles(next, N_LOADS * N_LOADS);
    map->rest_cross = take_doubles(next, N_LOADS * n);
    map->noise = take_doubles(next, n * n);
    map->shared = take_doubles(next, map->n_shared * n);
    map->of_gauge = take_doubles(next, map->n_terms * (1 + N_LOADS) * n);
    map->own = take_doubles(next, map->n_own * n);
    map->further_load = take_doubles(next, map->n_further * map->n_seen);
    map->further_cross = take_doubles(next, map->n_further * n);
    map->further_variance = take_doubles(next, map->n_further);
}

static int sensible_values(const FilterMap *map, const double *values, size_t count, size_t n) {
    int good = 1;
    for (size_t i = 0; i < count; i++) {
        good = good && isfinite(values[i]);
    }
    for (size_t k = 0; k < N_STATES; k++) {
        good = good && map->rate[k] > 0.0;
    }
    for (size_t g = 0; g < n; g++) {
        good = good && map->noise[g * n + g] > 0.0;
    }
    return good && map->rate_time >= 0.0 && map->slow > 0.0 && map->white_navigation > 0.0
        && map->white_navigation <= 1.0 && map->window >= 1.0 && map->band > 0.0 && map->widen >= 1.0
        && map->narrow > 0.0 && map->narrow <= 1.0 && map->largest_widening >= 1.0 && map->smallest_time > 0.0
        && map->largest_time > map->smallest_time && map->named_after >= 1.0 && map->fits > 0.0
        && map->slope_time > 0.0 && map->of_age > 0.0 && map->longest_step > 0.0;
}

int filter_map_parse(const Section *section, size_t n_gauges, FilterMap *map, char text[MODEL_TEXT_SIZE]) {
    const unsigned char *content = section->content;
    size_t sizes[N_FILTER_SIZES];
    int good = section->length >= 4 * N_FILTER_SIZES;
    for (size_t k = 0; good && k < N_FILTER_SIZES; k++) {
        sizes[k] = u32_at(content, 4 * k);
        const int many = k == N_FURTHER_LOADS || k == N_SHARED || k == N_OF_MODES;
        good = sizes[k] <= (many ? MOST_COLUMNS : LARGEST_NUMBER);
    }
    if (good) {
        map->n_seen = sizes[N_SEEN];
        map->n_shared = sizes[N_SHARED];
        map->n_terms = sizes[N_TERMS];
        map->n_own = sizes[N_OWN];
        map->n_further = sizes[N_FURTHER_LOADS];
        map->n_modes = sizes[N_OF_MODES];
        good = map->n_own <= 1 && map->n_modes <= map->n_shared
            && section->length == 4 * N_FILTER_SIZES + 8 * number_of_doubles(map, n_gauges);
    }
    if (!good) {
        snprintf(text, MODEL_TEXT_SIZE, "holds a filter whose sizes cannot be");
        return 0;
    }
    const double *values = (const double *)(const void *)(content + 4 * N_FILTER_SIZES), *next = values;
    take_scalars(map, &next);
    take_arrays(map, &next, n_gauges);
    if (!sensible_values(map, values, number_of_doubles(map, n_gauges), n_gauges)) {
        snprintf(text, MODEL_TEXT_SIZE, "holds a filter with a value that cannot be");
        return 0;
    }
    return 1;
}
