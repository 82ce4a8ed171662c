/* The matrices of a map for the gauges in use and for the standard deviations of zero offsets: made once for each,
   and kept.

   Two things change what follows from a map. Another set of gauges asks for a MaskedMap; CACHED_MASKS sets are kept,
   since gauges that come and go return to the same few sets, and the one that has not been used for longest gives
   way. Other standard deviations of zero offsets change the covariance itself,

       added = diag(zero_std^2) + zero_common_std^2 1 1'        (n_strains, n_strains),

   and with it all matrices: added_noise.c makes these in parts, and every MaskedMap is made again.
   docs/explanation/theory.md, "Missing and suspect gauges"; docs/reference/step_time.md, "Matrices for other zero
   offsets". */

#include "prepared.h"

#include <string.h>

#include "../sample/readings.h"

void prepared_arrays(Map *map, size_t n_strains, Prepared *prepared, Room *room) {
    prepared->map = map;
    for (int k = 0; k < CACHED_MASKS; k++) {
        masked_map_arrays(map, &prepared->cache[k], room);
    }
    prepared->mask = piece(room, map->n_gauges, 1);
    workspace_arrays(map, &prepared->work, room);
    added_noise_arrays(map, &prepared->noise, room);
    prepared->n_strains = n_strains;
    prepared->noise_std = taken(room, n_strains + 1);
    prepared->next_std = taken(room, n_strains + 1);
}

int prepared_begin(Prepared *prepared) {
    added_noise_begin(&prepared->noise);
    while (!added_noise_part(&prepared->noise, SIZE_MAX)) {
    }
    return added_noise_hand_out(&prepared->noise, prepared->map);
}

void prepared_follow(Prepared *prepared, const Inputs *inputs) {
    const size_t n = prepared->map->n_gauges;
    const double range = scalar_input(inputs, SENSOR_RANGE);
    const int silent = readings_silent(inputs);
    /* The usual step: the same gauges as in the last one, without looking at the cache. */
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
    /* The number is new: what steps have computed for the set that was here before does not count. */
    prepared->masked->number = prepared->uses;
    masked_map_prepare(prepared->map, prepared->masked, &prepared->work);
}

int prepared_holds(const Prepared *prepared, const double *std) {
    return memcmp(prepared->noise_std, std, (prepared->n_strains + 1) * sizeof *std) == 0;
}

void prepared_renew(Prepared *prepared, const double *std) {
    const size_t n = prepared->n_strains, stride = prepared->map->n_gauges;
    const double common = std[n] * std[n];
    memcpy(prepared->next_std, std, (n + 1) * sizeof *std);
    for (size_t i = 0; i < n; i++) { /* other sensors have no zeros */
        for (size_t j = 0; j < n; j++) {
            prepared->noise.added[i * stride + j] = common + (i == j ? std[i] * std[i] : 0.0);
        }
    }
    added_noise_begin(&prepared->noise);
}

int prepared_part(Prepared *prepared, size_t work) {
    return added_noise_part(&prepared->noise, work);
}

void prepared_renewed(Prepared *prepared) {
    memcpy(prepared->noise_std, prepared->next_std, (prepared->n_strains + 1) * sizeof *prepared->noise_std);
    /* Sets of gauges were prepared for the old covariance. */
    memset(prepared->last_use, 0, sizeof prepared->last_use);
    prepared->masked = NULL;
    added_noise_hand_out(&prepared->noise, prepared->map);
}
