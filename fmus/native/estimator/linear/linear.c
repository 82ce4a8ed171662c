#include "linear.h"

#include <math.h>
#include <string.h>

#include "../update/scaled_form.h"
#include "linear_outputs.h"

size_t linear_doubles(const Linear *linear, size_t n_strains) {
    const Map *map = linear->map;
    const size_t n_other = linear->other_loads->present ? linear->other_loads->map.n_loads : 0;
    return prepared_doubles(map, n_strains, n_other) + half_space_doubles(&map->envelope) + scaled_doubles(map, n_other);
}

size_t linear_indices(const Map *map) {
    return prepared_indices(map) + scaled_indices(map);
}

/* Those of every step first: they are aligned as the block is. */
void linear_arrays(Map *map, size_t n_strains, Linear *linear, double **doubles, size_t **indices,
                   unsigned char **bytes) {
    linear->prepared.noise.wide = linear->prepared.work.wide = linear->wide;
    linear->prepared.noise.other_loads = linear->other_loads->present ? linear->other_loads : NULL;
    linear->scaled.map = map;
    linear->scaled.other_loads = linear->prepared.noise.other_loads;
    linear->scaled.wide = linear->wide;
    scaled_arrays(&linear->scaled, doubles, indices);
    half_space_arrays(&map->envelope, &linear->half_spaces, doubles);
    prepared_arrays(map, n_strains, &linear->prepared, doubles, indices, bytes);
}

int linear_begin(Linear *linear) {
    const int good = prepared_begin(&linear->prepared);
    if (good) {
        scaled_prepare(&linear->scaled);
    }
    return good;
}

void linear_renewed(Linear *linear) {
    prepared_renewed(&linear->prepared);
    scaled_prepare(&linear->scaled);
}

/* Flow and navigation of the inputs. */
static Flow flow_of(const Linear *linear) {
    const double pressure = scalar_input(linear->inputs, DYNAMIC_PRESSURE);
    Flow flow = {0, pressure, 0.0, known_input(linear->inputs, MACH_NUMBER), known_input(linear->inputs, ALTITUDE)};
    if (!(pressure >= linear->map->min_dynamic_pressure && pressure <= linear->map->max_dynamic_pressure)) {
        return flow;
    }
    const double given = known_input(linear->inputs, DYNAMIC_PRESSURE_STD);
    const double deviation = isnan(given) ? linear->map->dynamic_pressure_error * pressure : given;
    flow.known = deviation >= 0.0 && deviation < INFINITY;
    flow.deviation = flow.known ? deviation : 0.0;
    return flow;
}

static int health_state(const Linear *linear) {
    const double *output = linear->output;
    if (!linear->flow.known) {
        return NO_COEFFICIENTS;
    }
    if (outside_by_navigation(&linear->map->envelope, &linear->flow) || parameter_beyond(linear->inputs) != SIZE_MAX) {
        return OUTSIDE;
    }
    if (output[CHI_SQUARE] > output[CHI_SQUARE_LIMIT]) {
        return INCONSISTENT;
    }
    if (output[SUSPECTS] > 0.0) {
        return SUSPECT;
    }
    if (output[ENVELOPE_SCORE] > linear->map->envelope.score_limit) {
        return OUTSIDE;
    }
    return linear->prepared.masked->n_used == linear->map->n_gauges ? OK : DEGRADED;
}

void linear_update(Linear *linear) {
    double *output = linear->output;
    prepared_follow(&linear->prepared, linear->inputs);
    const MaskedMap *m = linear->prepared.masked;
    output[VALID_GAUGES] = (double)m->n_used;
    output[SUSPECT_GAUGE] = output[SUSPECTS] = 0.0;
    if (!m->identified) {
        set_unknown(output);
        output[HEALTH_STATE] = m->n_used > 0 ? UNIDENTIFIED : INVALID;
        return;
    }
    linear->flow = flow_of(linear);
    if (linear->flow.known || !linear->map->form.follows_pressure) {
        linear_outputs(linear);
    } else {
        set_unknown(output);
    }
    output[HEALTH_STATE] = health_state(linear);
}

int linear_loads_at(Linear *linear, double dynamic_pressure, double deviation) {
    double kept[N_OUTPUTS];
    memcpy(kept, linear->output, sizeof kept);
    prepared_follow(&linear->prepared, linear->inputs);
    const MaskedMap *m = linear->prepared.masked;
    Flow flow = {.pressure = dynamic_pressure, .deviation = deviation, .mach_number = NAN, .altitude = NAN};
    flow.known = dynamic_pressure >= linear->map->min_dynamic_pressure
              && dynamic_pressure <= linear->map->max_dynamic_pressure && deviation >= 0.0 && deviation < INFINITY;
    linear->flow = flow;
    int found = m->identified && linear->flow.known;
    if (found) {
        linear_outputs(linear);
    }
    for (int i = 0; i < N_LOADS; i++) {
        found = found && isfinite(linear->output[COEFFICIENTS + i]);
    }
    const size_t first = found ? HEALTH_STATE : 0;
    memcpy(linear->output + first, kept + first, (N_OUTPUTS - first) * sizeof *kept);
    return found;
}
