#include "linear_filter.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "../../core/elementary.h"
#include "../numerics/arrays.h"
#include "../numerics/lanes.h"
#include "../numerics/products.h"

#define ALIGNMENT 64
#define LARGEST_AGE 690.0 /* in time constants; nothing is left of a state beyond it */

size_t linear_law_doubles(const LinearFilter *filter) {
    const size_t columns = filter->order + filter->n_considered + filter->zeros.columns;
    return filter->order + filter->n * columns + zero_errors_noted(&filter->zeros) + filter->map.n_modes
         + filter->n_sensors;
}

static void law_arrays(const LinearFilter *filter, LinearLaw *law, double **doubles) {
    law->mean = taken(doubles, filter->order);
    law->covariance = taken(doubles, filter->n * filter->order);
    law->cross = taken(doubles, filter->n * filter->n_considered);
    law->of_zeros = taken(doubles, filter->n * filter->zeros.columns);
    law->zero = taken(doubles, zero_errors_noted(&filter->zeros));
    law->amplitude = taken(doubles, filter->map.n_modes);
    law->known = taken(doubles, filter->n_sensors);
}

static size_t number_of_doubles(const LinearFilter *filter) {
    const size_t rows = filter->rows, order = filter->order, larger = rows > order ? rows : order;
    return 4 * linear_law_doubles(filter) + zero_errors_doubles(&filter->zeros) + 4 * rows * rows + (1 + 2 * filter->n_considered) * rows
         + (5 * order + LANES + N_LOADS) * rows + (N_LOADS + larger + 4 * order) * order;
}

static void set_arrays(LinearFilter *filter, double *next) {
    const size_t rows = filter->rows, order = filter->order, considered = filter->n_considered;
    law_arrays(filter, &filter->law, &next);
    law_arrays(filter, &filter->next_law, &next);
    law_arrays(filter, &filter->predicted, &next);
    law_arrays(filter, &filter->stationary, &next);
    zero_errors_arrays(&filter->zeros, &next);
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
    filter->joseph = taken(&next, 2 * order * order);
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
    filter->thermal = thermal;
    filter->n_sensors = thermal->present ? thermal->map.n_sensors : 0;
    filter->wide = wide;
    filter->n_gauges = n_gauges;
    filter->rows = in_lanes(n_gauges);
    filter->n = map->n_scaled + map->n_common;
    filter->order = in_lanes(filter->n);
    filter->n_considered = in_lanes(map->n_own + map->n_rest);
    zero_errors_lay_out(n_strains, n_gauges, &filter->zeros);
    const size_t count = number_of_doubles(filter);
    filter->memory = calloc(1, ALIGNMENT + count * sizeof(double) + n_gauges);
    if (filter->memory == NULL) {
        return map_no_memory(file);
    }
    unsigned char *start = filter->memory;
    double *doubles = (double *)(void *)(start + (ALIGNMENT - (uintptr_t)start % ALIGNMENT));
    set_arrays(filter, doubles);
    filter->used = (unsigned char *)(doubles + count);
    for (size_t i = 0; i < filter->n; i++) {
        filter->stationary.covariance[i * filter->order + i] = map->std[i] * map->std[i];
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

static double left_after(double age) {
    return age < LARGEST_AGE ? exponential(-age) : 0.0;
}

void linear_filter_set_stationary(LinearFilter *filter) {
    const size_t first_mode = filter->n - filter->map.n_modes;
    for (size_t i = first_mode; i < filter->n; i++) {
        double *row = filter->stationary.covariance + i * filter->order + first_mode;
        memset(row, 0, filter->map.n_modes * sizeof *row);
        thermal_add_left(filter->thermal, i - first_mode, 1.0, row);
    }
}

void linear_filter_predict(LinearFilter *filter, double time_step, double time_constant) {
    const size_t order = filter->order, considered = filter->n_considered, n_scaled = filter->map.n_scaled;
    const double age = time_step / time_constant, fast = left_after(age), slow = left_after(age / filter->map.slow);
    const size_t first_mode = filter->n - filter->map.n_modes;
    const LinearLaw *law = &filter->law;
    LinearLaw *out = &filter->predicted;
    thermal_tell(filter->thermal, out->amplitude, out->known);
    zero_errors_note(&filter->zeros, out->zero);
    const int same = memcmp(out->known, law->known, filter->n_sensors * sizeof *out->known) == 0;
    for (size_t i = 0; i < filter->n; i++) {
        const int is_fast = i < n_scaled || i >= first_mode;
        const double own = is_fast ? fast : slow, std = filter->map.std[i];
        const double *from = law->covariance + i * order;
        double *to = out->covariance + i * order;
        out->mean[i] = own * law->mean[i];
        for (size_t j = 0; j < order; j++) {
            to[j] = own * (j < n_scaled || j >= first_mode ? fast : slow) * from[j];
        }
        if (i < first_mode) {
            to[i] += std * std * (1.0 - own * own);
        } else {
            out->mean[i] += same ? 0.0 : own * (law->amplitude[i - first_mode] - out->amplitude[i - first_mode]);
            thermal_add_left(filter->thermal, i - first_mode, 1.0 - fast * fast, to + first_mode);
        }
        combine(filter->wide, considered, fast * own, law->cross + i * considered, 0.0, law->cross + i * considered,
                out->cross + i * considered);
        if (filter->zeros.in_use) {
            const double *with = law->of_zeros + i * filter->zeros.columns;
            combine(filter->wide, filter->zeros.columns, own, with, 0.0, with, out->of_zeros + i * filter->zeros.columns);
        }
    }
}

size_t linear_filter_state_size(const LinearFilter *filter) {
    return filter->present ? sizeof filter->base + sizeof(double) * linear_law_doubles(filter) : 0;
}

void linear_filter_write_state(const LinearFilter *filter, unsigned char *bytes) {
    if (filter->present) {
        const size_t size = sizeof(double) * linear_law_doubles(filter);
        memcpy(bytes, &filter->base, sizeof filter->base);
        if (filter->base.has_law == 0.0) {
            memset(bytes + sizeof filter->base, 0, size);
            return;
        }
        memcpy(bytes + sizeof filter->base, filter->law.mean, size);
        if (!zero_errors_noted_any(&filter->zeros, filter->law.zero)) {
            const size_t before = (size_t)(filter->law.of_zeros - filter->law.mean);
            memset(bytes + sizeof filter->base + before * sizeof(double), 0,
                   filter->n * filter->zeros.columns * sizeof(double));
        }
    }
}

int linear_filter_state_fits(const LinearFilter *filter, const unsigned char *bytes) {
    LinearTrack track;
    if (!filter->present) {
        return 1;
    }
    memcpy(&track, bytes, sizeof track);
    int good = (track.has_law == 0.0 || track.has_law == 1.0) && (track.stepped == 0.0 || track.stepped == 1.0)
            && isfinite(track.time) && isfinite(track.now);
    for (size_t k = 0; k < linear_law_doubles(filter); k++) {
        double value;
        memcpy(&value, bytes + sizeof track + k * sizeof value, sizeof value);
        good = good && isfinite(value);
    }
    return good;
}

void linear_filter_read_state(LinearFilter *filter, const unsigned char *bytes) {
    if (filter->present) {
        memcpy(&filter->base, bytes, sizeof filter->base);
        memcpy(filter->law.mean, bytes + sizeof filter->base, sizeof(double) * linear_law_doubles(filter));
    }
}
