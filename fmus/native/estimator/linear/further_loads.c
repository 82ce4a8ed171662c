#include "further_loads.h"

#include <math.h>
#include <stdlib.h>

#include "../estimator.h"
#include "../numerics/triangles.h"
#include "error_levels.h"

#define MAX_LOADS 4096

static int parse(MapFile *file, size_t n, size_t states, FurtherMap *map) {
    const size_t m = map->n_loads = map_length(file, "further.is_moment", 0, 1, MAX_LOADS);
    map_require(file, m % SECTION_LOADS == 1, "further.is_moment", "one for the body, and six for each section");
    map->is_moment = map_doubles(file, "further.is_moment", m);
    map->fixed = map_doubles(file, "further.fixed_load", m);
    map->of_mean = map_doubles(file, "further.load_of_mean", m);
    map->load_per_state = map_doubles(file, "further.load_per_state", states, m);
    map->spread_load = map_doubles(file, "further.spread_load", n, m);
    map->spread_unseen = map_doubles(file, "further.spread_unseen", m);
    return file->good;
}

int further_create(MapFile *file, size_t n_gauges, size_t n_states, size_t n_levels, Further *further) {
    if (!map_has(file, "further")) {
        return file->good;
    }
    if (!parse(file, n_gauges, n_states, &further->map)) {
        return 0;
    }
    const size_t m = further->map.n_loads, pairs = N_PAIRS * m;
    const size_t count = 2 * n_gauges * m + m + n_levels * pairs + 2 * m * n_gauges + pairs + n_gauges + N_FURTHER * m;
    further->memory = calloc(count, sizeof(double));
    if (further->memory == NULL) {
        return map_no_memory(file);
    }
    further->load = further->memory;
    further->unseen = further->load + n_gauges * m;
    further->products = further->unseen + m;
    further->gain = further->products + n_levels * pairs;
    further->rows = further->gain + n_gauges * m;
    further->scratch = further->rows + 2 * m * n_gauges;
    further->value[0] = further->scratch + pairs + n_gauges;
    for (int k = 1; k < N_FURTHER; k++) {
        further->value[k] = further->value[k - 1] + m;
    }
    further->present = further->outdated = 1;
    return 1;
}

void further_free(Further *further) {
    free(further->memory);
}

/* From those kept if they are there. */
static const double *further_level_products(Estimator *e, const Level *level) {
    Further *further = &e->further;
    Level *first = e->levels[e->masked - e->cache].level, *found = first + (level - first);
    const size_t number = (size_t)(e->masked - e->cache) * CACHED_LEVELS + (size_t)(level - first);
    double *products = further->products + number * N_PAIRS * further->map.n_loads;
    if (!found->has_further) {
        further_level(e, found->ratio, products);
        found->has_further = 1;
    }
    return products;
}

static double further_growth(Estimator *e, size_t load) {
    const ScaledStep *step = &e->scaled.step;
    const size_t n = e->map.n_gauges, m = e->further.map.n_loads;
    double *more = e->further.scratch + N_PAIRS * m;
    for (size_t j = 0; j < step->n_lost; j++) {
        const double *column = e->map.form.whitening + step->lost[j] * n;
        more[j] = 0.0;
        for (size_t a = 0; a < n; a++) {
            more[j] += step->weight[a] * e->further.load[a * m + load] * column[a];
        }
    }
    solve_transposed(n, step->n_lost, step->matrix, more);
    return dot(step->n_lost, more, more);
}

void further_load(Estimator *e, size_t j, double *value, double *variance, double *per_pressure) {
    const Further *further = &e->further;
    const ScaledStep *step = &e->scaled.step;
    const size_t n = e->map.n_gauges, m = further->map.n_loads;
    const double s = step->ratio;
    double sum = 0.0, of_mean = 0.0, spread = 0.0;
    for (size_t a = 0; a < n; a++) {
        const double load = further->load[a * m + j], weighted = step->weight[a] * load;
        sum += weighted * step->w[a];
        of_mean += weighted * step->of_mean[a];
        spread += step->spread[a] * (load * load);
    }
    *value = further->map.fixed[j] + s * further->map.of_mean[j] + sum;
    *per_pressure = (further->map.of_mean[j] - of_mean) / e->map.dynamic_pressure;
    *variance = spread + s * s * further->unseen[j] + (step->n_lost > 0 ? further_growth(e, j) : 0.0);
    if (e->map.form.has_errors) {
        const double *low = further_level_products(e, step->levels[0]), *high = further_level_products(e, step->levels[1]);
        double of_low = 0.0, of_high = 0.0;
        for (size_t pair = 0; pair < N_PAIRS; pair++) {
            of_low += step->product[pair] * low[pair * m + j];
            of_high += step->product[pair] * high[pair * m + j];
        }
        *variance += s * s * ((1.0 - step->part) * of_low + step->part * of_high);
    }
    *variance = *variance > 0.0 ? *variance : 0.0;
}

void further_update(Estimator *e) {
    Further *further = &e->further;
    const double *scalar = e->input + e->map.n_gauges;
    further->outdated = 0;
    if (e->flight.present && !e->flight.flag[LINEAR_LOADS]) {
        flight_further_update(e);
        return;
    }
    const int known = e->masked->identified && e->flow.known;
    for (size_t j = 0; j < further->map.n_loads; j++) {
        double value = NAN, variance = NAN, per_pressure = NAN, scale = NAN;
        if (known) {
            const double length = further->map.is_moment[j] > 0.0 ? scalar[REFERENCE_LENGTH] : 1.0;
            further_load(e, j, &value, &variance, &per_pressure);
            scale = 1.0 / (e->flow.pressure * (scalar[REFERENCE_AREA] * length));
        }
        const double of_pressure = per_pressure * e->flow.deviation, coefficient = scale * value;
        const double of_both = scale * of_pressure - coefficient * (e->flow.deviation / e->flow.pressure);
        further->value[FURTHER_LOADS][j] = value;
        further->value[FURTHER_LOADS_STD][j] = sqrt(variance + of_pressure * of_pressure);
        further->value[FURTHER_COEFFICIENTS][j] = coefficient;
        further->value[FURTHER_COEFFICIENTS_STD][j] = sqrt(scale * scale * variance + of_both * of_both);
    }
}
