#include "further_loads.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "../estimator.h"
#include "../numerics/triangles.h"
#include "error_levels.h"

#define N_FURTHER_SIZES 8
#define MAX_LOADS 4096

static size_t number_of_doubles(size_t m, size_t n, size_t states) {
    return 5 * m + 2 * n * m + states * m;
}

static int parse(const Section *section, size_t n, size_t states, FurtherMap *map, char *text) {
    const size_t values_at = 4 * N_FURTHER_SIZES;
    const size_t m = section->length >= values_at ? u32_at(section->content, 0) : 0;
    if (m < 1 || m > MAX_LOADS || (m - 1) % SECTION_LOADS != 0 || section->length != values_at + 8 * number_of_doubles(m, n, states)) {
        snprintf(text, MODEL_TEXT_SIZE, "holds further loads whose number cannot be");
        return 0;
    }
    const double *values = (const double *)(const void *)(section->content + values_at), *next = values;
    map->n_loads = m;
    map->is_moment = take_doubles(&next, m);
    map->load = take_doubles(&next, n * m);
    map->unseen = take_doubles(&next, m);
    map->fixed = take_doubles(&next, m);
    map->of_mean = take_doubles(&next, m);
    map->load_per_state = take_doubles(&next, states * m);
    map->spread_load = take_doubles(&next, n * m);
    map->spread_unseen = take_doubles(&next, m);
    for (size_t i = 0; i < number_of_doubles(m, n, states); i++) {
        if (!isfinite(values[i])) {
            snprintf(text, MODEL_TEXT_SIZE, "holds further loads with a value that cannot be");
            return 0;
        }
    }
    return 1;
}

int further_create(const Section *section, size_t n_gauges, size_t n_states, size_t n_levels, Further *further,
                   char text[MODEL_TEXT_SIZE]) {
    if (section->content == NULL) {
        return 1;
    }
    if (!parse(section, n_gauges, n_states, &further->map, text)) {
        return 0;
    }
    const size_t m = further->map.n_loads, pairs = N_PAIRS * m;
    const size_t count = 2 * n_gauges * m + m + n_levels * pairs + 2 * m * n_gauges + pairs + n_gauges + N_FURTHER * m;
    further->memory = calloc(count, sizeof(double));
    if (further->memory == NULL) {
        snprintf(text, MODEL_TEXT_SIZE, "needs more memory than there is");
        return 0;
    }
    further->own_load = further->memory;
    further->own_unseen = further->own_load + n_gauges * m;
    further->products = further->own_unseen + m;
    further->gain = further->products + n_levels * pairs;
    further->rows = further->gain + n_gauges * m;
    further->scratch = further->rows + 2 * m * n_gauges;
    further->value[0] = further->scratch + pairs + n_gauges;
    for (int k = 1; k < N_FURTHER; k++) {
        further->value[k] = further->value[k - 1] + m;
    }
    further->load = further->map.load;
    further->unseen = further->map.unseen;
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
