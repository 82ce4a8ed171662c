#include "further_loads.h"

#include <math.h>
#include <stdlib.h>

#include "../estimator.h"
#include "../numerics/triangles.h"
#include "current_errors.h"

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

int further_create(MapFile *file, size_t n_gauges, size_t n_states, Further *further) {
    if (!map_has(file, "further")) {
        return file->good;
    }
    if (!parse(file, n_gauges, n_states, &further->map)) {
        return 0;
    }
    const size_t m = further->map.n_loads;
    const size_t count = 3 * n_gauges * m + m + n_gauges + N_FURTHER * m;
    further->memory = calloc(count, sizeof(double));
    if (further->memory == NULL) {
        return map_no_memory(file);
    }
    further->load = further->memory;
    further->unseen = further->load + n_gauges * m;
    further->rows = further->unseen + m;
    further->growth = further->rows + 2 * m * n_gauges;
    further->value[0] = further->growth + n_gauges;
    for (int k = 1; k < N_FURTHER; k++) {
        further->value[k] = further->value[k - 1] + m;
    }
    further->present = further->outdated = 1;
    return 1;
}

void further_free(Further *further) {
    free(further->memory);
}

/* Row j of B, further->growth: what the lost gauges add to the variance is its square. */
static void set_growth(Estimator *e, size_t j) {
    const ScaledStep *step = &e->scaled.step;
    const size_t n = e->map.n_gauges, m = e->further.map.n_loads;
    double *growth = e->further.growth;
    for (size_t k = 0; k < step->n_lost; k++) {
        const double *column = e->map.form.whitening + step->lost[k] * n;
        growth[k] = 0.0;
        for (size_t a = 0; a < n; a++) {
            growth[k] += step->weight[a] * e->further.load[a * m + j] * column[a];
        }
    }
    solve_transposed(n, step->n_lost, step->matrix, growth);
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
    set_growth(e, j);
    *variance = spread + s * s * further->unseen[j] + dot(step->n_lost, further->growth, further->growth);
    if (e->map.form.has_errors) {
        *variance += s * s * current_errors_of_further(e, j, further->growth);
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
