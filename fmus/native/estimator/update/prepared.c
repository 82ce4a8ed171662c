#include "prepared.h"

#include <string.h>

#include "../numerics/arrays.h"
#include "../sample/readings.h"

size_t prepared_doubles(const Map *map, size_t n_strains) {
    return CACHED_MASKS * masked_map_doubles(map) + workspace_doubles(map) + added_noise_doubles(map) + n_strains + 1;
}

size_t prepared_indices(const Map *map) {
    return CACHED_MASKS * masked_map_indices(map) + map->n_gauges;
}

size_t prepared_bytes(const Map *map) {
    return (CACHED_MASKS + 1) * map->n_gauges;
}

void prepared_arrays(Map *map, size_t n_strains, Prepared *prepared, double **doubles, size_t **indices,
                     unsigned char **bytes) {
    const size_t n = map->n_gauges;
    prepared->map = map;
    for (int k = 0; k < CACHED_MASKS; k++) {
        prepared->cache[k].mask = *bytes + (size_t)k * n;
        masked_map_arrays(map, &prepared->cache[k], doubles, indices);
    }
    prepared->mask = *bytes + CACHED_MASKS * n;
    *bytes += prepared_bytes(map);
    workspace_arrays(map, &prepared->work, doubles, indices);
    added_noise_arrays(map, &prepared->noise, doubles);
    prepared->noise_std = taken(doubles, n_strains + 1);
}

int prepared_begin(Prepared *prepared) {
    return added_noise_apply(&prepared->noise, prepared->map, &prepared->cache[0], &prepared->work);
}

void prepared_follow(Prepared *prepared, const Inputs *inputs) {
    const size_t n = prepared->map->n_gauges;
    const double range = scalar_input(inputs, SENSOR_RANGE);
    const int silent = readings_silent(inputs);
    if (!silent && prepared->masked != NULL && readings_are_of(inputs, prepared->masked->mask)) {
        return;
    }
    for (size_t i = 0; i < n; i++) {
        prepared->mask[i] = !silent && gauge_in_use(inputs, i, range);
    }
    int oldest = 0;
    prepared->uses++;
    for (int k = 0; k < CACHED_MASKS; k++) {
        if (prepared->last_use[k] > 0 && memcmp(prepared->cache[k].mask, prepared->mask, n) == 0) {
            prepared->last_use[k] = prepared->uses;
            prepared->masked = &prepared->cache[k];
            return;
        }
        oldest = prepared->last_use[k] < prepared->last_use[oldest] ? k : oldest;
    }
    prepared->last_use[oldest] = prepared->uses;
    prepared->masked = &prepared->cache[oldest];
    memcpy(prepared->masked->mask, prepared->mask, n);
    masked_map_prepare(prepared->map, prepared->masked, &prepared->work);
}

/* The covariance of the errors of the zeros in use; other sensors have none. */
static void set_added_noise(Prepared *prepared, size_t n) {
    const size_t stride = prepared->map->n_gauges;
    const double *std = prepared->noise_std;
    const double common = std[n] * std[n];
    for (size_t i = 0; i < n; i++) {
        for (size_t j = 0; j < n; j++) {
            prepared->noise.added[i * stride + j] = common + (i == j ? std[i] * std[i] : 0.0);
        }
    }
}

int prepared_renew(Prepared *prepared, const double *std, size_t n_strains, int other) {
    const size_t size = (n_strains + 1) * sizeof *std;
    if (!other && memcmp(prepared->noise_std, std, size) == 0) {
        return 0;
    }
    memcpy(prepared->noise_std, std, size);
    set_added_noise(prepared, n_strains);
    memset(prepared->last_use, 0, sizeof prepared->last_use);
    prepared->masked = NULL;
    added_noise_apply(&prepared->noise, prepared->map, &prepared->cache[0], &prepared->work);
    return 1;
}
