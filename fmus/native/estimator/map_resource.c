#include "map_resource.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#define N_SCALARS 10
#define MAX_COUNT 4096

static const char MAGIC[8] = "SFMUMAP";

static size_t number_of_doubles(size_t n, size_t states) {
    const size_t loads = N_LOADS, triangle = n * (n + 1) / 2;
    return N_SCALARS + n + loads + loads * n + loads * loads + 4 * triangle + loads * n + loads * loads + states * n
         + states * loads + 3 * n;
}

static int check_sizes(const unsigned char *bytes, size_t length, char *text) {
    const uint32_t n = u32_at(bytes, 32), states = u32_at(bytes, 36);
    const uint32_t freedom = u32_at(bytes, 40), known_prior = u32_at(bytes, 44);
    if (n < 1 || n > MAX_COUNT || states > MAX_COUNT || freedom < 1 || freedom > n || known_prior > 1) {
        snprintf(text, MODEL_TEXT_SIZE, "is for %lu gauges, %lu states, %lu degrees of freedom, which cannot be",
                 (unsigned long)n, (unsigned long)states, (unsigned long)freedom);
        return 0;
    }
    if (length != HEADER_SIZE + 8 * number_of_doubles(n, states)) {
        snprintf(text, MODEL_TEXT_SIZE, "has %lu bytes, which is wrong for %lu gauges and %lu states",
                 (unsigned long)length, (unsigned long)n, (unsigned long)states);
        return 0;
    }
    if (memchr(bytes + 48, '\0', HEADER_SIZE - 48) == NULL) {
        snprintf(text, MODEL_TEXT_SIZE, "holds a guid without an end");
        return 0;
    }
    return 1;
}

static const double *take(const double **next, size_t count) {
    const double *array = *next;
    *next += count;
    return array;
}

static int check_values(const Map *map, const double *values, size_t count, char *text) {
    for (size_t i = 0; i < count; i++) {
        if (!isfinite(values[i])) {
            snprintf(text, MODEL_TEXT_SIZE, "holds a value that is not finite (number %lu)", (unsigned long)i);
            return 0;
        }
    }
    const int positive = map->reference_area > 0.0 && map->reference_length > 0.0 && map->sensor_range > 0.0
                      && map->dynamic_pressure > 0.0 && map->min_dynamic_pressure > 0.0;
    if (!positive) {
        snprintf(text, MODEL_TEXT_SIZE, "holds a reference quantity that is not positive");
    }
    return positive;
}

static void take_arrays(Map *map, const double *next) {
    const size_t n = map->n_gauges, states = map->n_states, triangle = n * (n + 1) / 2;
    const double *scalars = take(&next, N_SCALARS);
    map->reference_area = scalars[0];
    map->reference_length = scalars[1];
    map->moment_station = scalars[2];
    map->sensor_range = scalars[3];
    map->dynamic_pressure = scalars[4];
    map->min_information = scalars[5];
    map->ambiguous_correlation = scalars[6];
    map->min_dynamic_pressure = scalars[7];
    map->largest_sensor_range = scalars[8];
    map->largest_setting = scalars[9];
    map->mean_strain = take(&next, n);
    map->load_of_mean = take(&next, N_LOADS);
    map->load_gain = take(&next, N_LOADS * n);
    map->load_covariance = take(&next, N_LOADS * N_LOADS);
    map->residual_triangle = take(&next, triangle);
    map->gain_triangle = take(&next, triangle);
    map->noise_whitening = take(&next, triangle);
    map->noise_root = take(&next, triangle);
    map->regression = take(&next, N_LOADS * n);
    map->remainder = take(&next, N_LOADS * N_LOADS);
    map->state_operator = take(&next, states * n);
    map->load_per_state = take(&next, states * N_LOADS);
    map->min_precision = take(&next, n);
    map->chi_square_limit = take(&next, n);
    map->outlier_threshold = take(&next, n);
}

int map_parse(const unsigned char *bytes, size_t length, Map *map, char text[MODEL_TEXT_SIZE]) {
    if (!resource_check(bytes, length, MAGIC, MAP_FORMAT_VERSION, "map", text) || !check_sizes(bytes, length, text)) {
        return 0;
    }
    map->n_gauges = u32_at(bytes, 32);
    map->n_states = u32_at(bytes, 36);
    map->degrees_of_freedom = (int)u32_at(bytes, 40);
    map->known_prior = (int)u32_at(bytes, 44);
    map->checksum = u32_at(bytes, CHECKSUM_AT);
    map->guid = (const char *)bytes + 48;
    const double *values = (const double *)(const void *)(bytes + HEADER_SIZE);
    take_arrays(map, values);
    return check_values(map, values, number_of_doubles(map->n_gauges, map->n_states), text);
}
