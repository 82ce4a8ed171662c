#include "linear_filter.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "../numerics/arrays.h"
#include "../numerics/lanes.h"
#include "predict.h"

#define ALIGNMENT 64

static size_t number_of_doubles(const LinearFilter *filter) {
    const size_t rows = filter->rows, order = filter->laws.order, larger = rows > order ? rows : order;
    return laws_doubles(&filter->laws) + 4 * rows * rows + (1 + 2 * filter->laws.n_considered) * rows
         + (5 * order + LANES + N_LOADS) * rows + (N_LOADS + larger + 5 * order) * order;
}

static void set_arrays(LinearFilter *filter, double *next) {
    const size_t rows = filter->rows, order = filter->laws.order, considered = filter->laws.n_considered;
    laws_arrays(&filter->laws, &next);
    filter->own_covariance = taken(&next, rows * rows);
    filter->rest_covariance = taken(&next, rows * rows);
    filter->white = taken(&next, rows * rows);
    filter->factor = taken(&next, rows * rows);
    filter->apart = taken(&next, rows);
    filter->term = taken(&next, considered * rows);
    filter->term_turned = taken(&next, rows * considered);
    filter->read = taken(&next, order * rows);
    filter->read_turned = taken(&next, rows * order);
    filter->considered = taken(&next, order * rows);
    filter->product = taken(&next, order * rows);
    filter->gain = taken(&next, (order + LANES + N_LOADS) * rows);
    filter->of_load = taken(&next, N_LOADS * order);
    filter->turned = taken(&next, (rows > order ? rows : order) * order);
    filter->small = taken(&next, order * order);
    filter->kept = taken(&next, order * order);
    filter->joseph = taken(&next, 3 * order * order);
}

/* covariance (rows, rows) of `count` errors (count, n_gauges). */
static void set_covariance(const LinearFilter *filter, size_t count, const double *error, double *covariance) {
    const size_t n = filter->n_gauges;
    for (size_t k = 0; k < count; k++) {
        for (size_t i = 0; i < n; i++) {
            for (size_t j = 0; j < n; j++) {
                covariance[i * filter->rows + j] += error[k * n + i] * error[k * n + j];
            }
        }
    }
}

int linear_filter_create(MapFile *file, size_t n_gauges, size_t n_strains, int wide, LinearFilter *filter,
                         const Thermal *thermal) {
    LinearFilterMap *map = &filter->map;
    if (!map_has(file, "linear_filter")) {
        return file->good;
    }
    if (!linear_filter_map_parse(file, n_gauges, map)
        || !map_require(file, map->n_modes == thermal->map.n_modes, "linear_filter.n_modes",
                        "that of the temperature modes")) {
        return 0;
    }
    filter->n_gauges = n_gauges;
    filter->rows = in_lanes(n_gauges);
    Laws *laws = &filter->laws;
    laws->wide = wide;
    laws->thermal = thermal;
    laws->n_sensors = thermal->present ? thermal->map.n_sensors : 0;
    laws->n_modes = map->n_modes;
    laws->n = map->n_scaled + map->n_common;
    laws->order = in_lanes(laws->n);
    laws->n_considered = in_lanes(map->n_own + map->n_rest);
    laws->slow = map->slow;
    laws->first_slow = map->n_scaled;
    laws->end_slow = first_mode(laws);
    zero_errors_lay_out(n_strains, n_gauges, &laws->zeros);
    const size_t count = number_of_doubles(filter);
    filter->memory = calloc(1, ALIGNMENT + count * sizeof(double) + n_gauges);
    if (filter->memory == NULL) {
        return map_no_memory(file);
    }
    unsigned char *start = filter->memory;
    double *doubles = (double *)(void *)(start + (ALIGNMENT - (uintptr_t)start % ALIGNMENT));
    set_arrays(filter, doubles);
    filter->used = (unsigned char *)(doubles + count);
    for (size_t i = 0; i < laws->n; i++) {
        laws->stationary.covariance[i * laws->order + i] = map->std[i] * map->std[i];
    }
    set_covariance(filter, map->n_own, map->own, filter->own_covariance);
    set_covariance(filter, map->n_rest, map->rest, filter->rest_covariance);
    filter->present = 1;
    return 1;
}

void linear_filter_free(LinearFilter *filter) {
    free(filter->memory);
}

void linear_filter_reset(LinearFilter *filter) {
    memset(&filter->base, 0, sizeof filter->base);
    filter->next = filter->base;
}

void linear_filter_predict(LinearFilter *filter, double time_step, double time_constant) {
    laws_predict(&filter->laws, time_step, time_constant, 1.0);
    laws_move_cross(&filter->laws);
}

size_t linear_filter_state_size(const LinearFilter *filter) {
    return filter->present ? sizeof filter->base + law_state_size(&filter->laws) : 0;
}

void linear_filter_write_state(const LinearFilter *filter, unsigned char *bytes) {
    if (filter->present) {
        memcpy(bytes, &filter->base, sizeof filter->base);
        law_write_state(&filter->laws, filter->base.has_law != 0.0, bytes + sizeof filter->base);
    }
}

int linear_filter_state_fits(const LinearFilter *filter, const unsigned char *bytes) {
    LinearTrack track;
    if (!filter->present) {
        return 1;
    }
    memcpy(&track, bytes, sizeof track);
    const int good = (track.has_law == 0.0 || track.has_law == 1.0) && (track.stepped == 0.0 || track.stepped == 1.0)
                  && isfinite(track.time) && isfinite(track.now);
    return good && law_state_fits(&filter->laws, bytes + sizeof track);
}

void linear_filter_read_state(LinearFilter *filter, const unsigned char *bytes) {
    if (filter->present) {
        memcpy(&filter->base, bytes, sizeof filter->base);
        law_read_state(&filter->laws, bytes + sizeof filter->base);
    }
}
