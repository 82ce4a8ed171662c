#include "estimator.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "linear/absolute_form.h"
#include "linear/scaled_form.h"
#include "numerics/panels.h"
#include "step_parts.h"

/* Bytes that vector loads like to start at a multiple of. */
#define ALIGNMENT 64

/* One block for all arrays: doubles, then indices, floats and bytes. */
static int allocate(Estimator *e) {
    const Map *map = &e->map;
    const size_t n = map->n_gauges;
    const size_t n_inputs = estimator_inputs(e);
    const size_t n_doubles = CACHED_MASKS * masked_map_doubles(map) + workspace_doubles(map) + 2 * n_inputs + 2 * n
                           + added_noise_doubles(map) + n + 1 + n_inputs + 3 * estimator_derivatives(e)
                           + 2 * panel_length(n) + half_space_doubles(&map->envelope)
                           + (map->scaled ? scaled_doubles(map, e->further.present ? e->further.map.n_loads : 0) : 0);
    const size_t n_indices = CACHED_MASKS * masked_map_indices(map) + n + (map->scaled ? scaled_indices(map) : 0);
    const size_t n_bytes = n_doubles * sizeof(double) + n_indices * sizeof(size_t) + n * sizeof(float);
    e->memory = calloc(1, ALIGNMENT + n_bytes + (CACHED_MASKS + 3) * n);
    if (e->memory == NULL) {
        return 0;
    }
    unsigned char *start = e->memory;
    double *doubles = (double *)(void *)(start + (ALIGNMENT - (uintptr_t)start % ALIGNMENT));
    size_t *indices = (size_t *)(void *)(doubles + n_doubles);
    e->narrow = (float *)(void *)(indices + n_indices);
    unsigned char *flags = (unsigned char *)(e->narrow + n);
    for (int k = 0; k < CACHED_MASKS; k++) {
        e->cache[k].mask = flags + (size_t)k * n;
        masked_map_arrays(map, &e->cache[k], &doubles, &indices);
    }
    half_space_arrays(&map->envelope, &e->half_spaces, &doubles);
    if (map->scaled) {
        scaled_arrays(e, &doubles, &indices);
    }
    workspace_arrays(map, &e->work, &doubles, &indices);
    added_noise_arrays(map, &e->noise, &doubles);
    e->noise.further = e->further.present ? &e->further : NULL;
    e->input = doubles;
    e->residual = e->input + n_inputs;
    e->z = e->residual + n;
    e->whitened = e->z + panel_length(n);
    e->direction = e->whitened + panel_length(n);
    e->strain = e->direction + n_inputs;
    e->noise_std = e->strain + n;
    e->derivative = e->noise_std + n + 1;
    e->derivative_work = e->derivative + estimator_derivatives(e);
    e->valid = flags + CACHED_MASKS * n;
    e->mask = e->valid + n;
    e->given = e->mask + n;
    return 1;
}

/* Whether the parts of a map go together: section loads scale with q_inf, tables of loads are those of the map's section
   loads, and filter and tables of parameters are about other tables. */
static int check_parts(MapFile *file, int scaled) {
    const int flight = map_has(file, "flight"), further = map_has(file, "further");
    const int has_form = scaled || !further;
    const int of_loads = map_has(file, "flight_loads") == (flight && further);
    const int of_tables = flight || !(map_has(file, "filter") || map_has(file, "parameter_tables"));
    const int of_linear = !map_has(file, "linear_filter") || !flight;
    if (file->good && !(has_form && of_loads && of_tables && of_linear)) {
        snprintf(file->text, MODEL_TEXT_SIZE, "holds parts that do not go together");
        file->good = 0;
    }
    return file->good;
}

/* Read all parts, and allocate. */
static int create(Estimator *e, MapFile *file) {
    const Map *map = &e->map;
    if (!map_parse(file, &e->map) || !check_parts(file, map->scaled)
        || !thermal_create(file, map->n_gauges, e->wide, &e->thermal) || !flow_parameters_parse(file, &e->parameters)
        || !sensor_rows_parse(file, map->n_gauges, &e->sensors)
        || !further_create(file, map->n_gauges, map->n_states, &e->further)) {
        return 0;
    }
    if (!allocate(e)) {
        return map_no_memory(file);
    }
    if (!added_noise_apply(&e->noise, &e->map, &e->cache[0], &e->work)) {
        map_require(file, 0, "linear.gauge_covariance", "a covariance");
        return 0;
    }
    if (map->scaled) {
        scaled_prepare(e);
    }
    const size_t n = e->sensors.n_strains;
    return flight_create(e, file)
        && linear_filter_create(file, map->n_gauges, n, e->wide, &e->linear_filter, &e->thermal)
        && tare_create(file, n, map->largest_zero, &e->tare) && map_close(file);
}

Estimator *estimator_create(unsigned char *bytes, size_t length, char text[MODEL_TEXT_SIZE]) {
    MapFile file;
    Estimator *e = calloc(1, sizeof *e);
    if (e == NULL) {
        snprintf(text, MODEL_TEXT_SIZE, "needs more memory than there is");
        free(bytes);
        return NULL;
    }
    e->bytes = bytes;
    e->wide = panels_wide();
    if (!map_open(&file, bytes, length, text) || !create(e, &file)) {
        estimator_free(e);
        return NULL;
    }
    estimator_reset(e);
    return e;
}

void estimator_free(Estimator *e) {
    if (e != NULL) {
        flight_free(&e->flight);
        linear_filter_free(&e->linear_filter);
        thermal_free(&e->thermal);
        further_free(&e->further);
        tare_free(&e->tare);
        free(e->memory);
        free(e->bytes);
        free(e);
    }
}

void estimator_reset(Estimator *e) {
    inputs_reset(e);
    flight_reset(&e->flight);
    linear_filter_reset(&e->linear_filter);
    tare_reset(&e->tare);
    e->outdated = e->noise_outdated = 1;
}

/* What a further sensor, by its number behind the strain gauges, reads without thrust. */
static double sensor_reading(const Estimator *e, size_t which) {
    const size_t place = thrust_input(e);
    const double thrust = place == SIZE_MAX ? 0.0 : e->input[place];
    const double reading = e->input[e->sensors.n_strains + which];
    return without_thrust(&e->sensors, which, reading, thrust == e->map.not_known ? NAN : thrust);
}

/* Whether what a further sensor reads is a number within its range. */
static int sensor_works(const Estimator *e, size_t which) {
    return fabs(sensor_reading(e, which)) <= e->sensors.largest[which];
}

unsigned char gauge_in_use(const Estimator *e, size_t i, double range) {
    const size_t n = e->sensors.n_strains;
    return (unsigned char)(e->valid[i] & e->given[i] & (i < n ? fabs(e->input[i]) <= range : sensor_works(e, i - n)));
}

int estimator_silent(const Estimator *e) {
    const double range = e->input[e->map.n_gauges + SENSOR_RANGE];
    int reads = 0;
    for (size_t i = 0; i < e->sensors.n_strains; i++) {
        const int in_use = gauge_in_use(e, i, range);
        if (in_use && e->input[i] != 0.0) {
            return 0;
        }
        reads |= in_use;
    }
    if (!reads) {
        return 0;
    }
    return e->flight.present || e->input[e->map.n_gauges + DYNAMIC_PRESSURE] >= e->map.min_dynamic_pressure;
}

void estimator_note_given(Estimator *e, size_t first, size_t end) {
    for (size_t i = first; e->n_given < e->map.n_gauges && i < end; i++) {
        e->n_given += !e->given[i];
        e->given[i] = 1;
    }
}

/* Whether the gauges in use are those of e->masked. */
static int same_mask(const Estimator *e, double range) {
    const size_t n = e->map.n_gauges;
    if (e->masked == NULL) {
        return 0;
    }
    int broken = e->n_given < n;
    for (size_t i = 0; i < e->sensors.n_strains; i++) {
        broken |= !(fabs(e->input[i]) <= range);
    }
    for (size_t k = 0; k < e->sensors.count; k++) {
        broken |= !sensor_works(e, k);
    }
    if (!broken) {
        return memcmp(e->masked->mask, e->valid, n) == 0;
    }
    int changed = 0;
    for (size_t i = 0; i < n; i++) {
        changed |= e->masked->mask[i] ^ gauge_in_use(e, i, range);
    }
    return !changed;
}

/* The matrices for the gauges in use: those of the step before, or from the cache if they are there. */
static MaskedMap *masked_map(Estimator *e) {
    const size_t n = e->map.n_gauges;
    const double range = e->input[n + SENSOR_RANGE];
    const int silent = estimator_silent(e);
    if (!silent && same_mask(e, range)) {
        return e->masked;
    }
    for (size_t i = 0; i < n; i++) {
        e->mask[i] = !silent && gauge_in_use(e, i, range);
    }
    int oldest = 0;
    e->uses++;
    for (int k = 0; k < CACHED_MASKS; k++) {
        if (e->last_use[k] > 0 && memcmp(e->cache[k].mask, e->mask, n) == 0) {
            e->last_use[k] = e->uses;
            return &e->cache[k];
        }
        oldest = e->last_use[k] < e->last_use[oldest] ? k : oldest;
    }
    e->last_use[oldest] = e->uses;
    memcpy(e->cache[oldest].mask, e->mask, n);
    masked_map_prepare(&e->map, &e->cache[oldest], &e->work);
    return &e->cache[oldest];
}

/* Flow and navigation of the inputs. */
static Flow flow_of(const Estimator *e) {
    const double *scalar = e->input + e->map.n_gauges;
    const double pressure = scalar[DYNAMIC_PRESSURE];
    Flow flow = {0, pressure, 0.0, known_input(e, MACH_NUMBER), known_input(e, ALTITUDE)};
    if (!(pressure >= e->map.min_dynamic_pressure && pressure <= e->map.max_dynamic_pressure)) {
        return flow;
    }
    const double given = known_input(e, DYNAMIC_PRESSURE_STD);
    const double deviation = isnan(given) ? e->map.dynamic_pressure_error * pressure : given;
    flow.known = deviation >= 0.0 && deviation < INFINITY;
    flow.deviation = flow.known ? deviation : 0.0;
    return flow;
}

static int health_state(const Estimator *e) {
    const double *output = e->output;
    if (!e->flow.known) {
        return NO_COEFFICIENTS;
    }
    if (outside_by_navigation(&e->map.envelope, &e->flow) || estimator_outside(e) != SIZE_MAX) {
        return OUTSIDE;
    }
    if (output[CHI_SQUARE] > output[CHI_SQUARE_LIMIT]) {
        return INCONSISTENT;
    }
    if (output[SUSPECTS] > 0.0) {
        return SUSPECT;
    }
    if (output[ENVELOPE_SCORE] > e->map.envelope.score_limit) {
        return OUTSIDE;
    }
    return e->masked->n_used == e->map.n_gauges ? OK : DEGRADED;
}

static void update(Estimator *e) {
    double *output = e->output;
    const MaskedMap *m = e->masked = masked_map(e);
    output[VALID_GAUGES] = (double)m->n_used;
    output[SUSPECT_GAUGE] = output[SUSPECTS] = 0.0;
    if (!m->identified) {
        set_unknown(output);
        output[HEALTH_STATE] = m->n_used > 0 ? UNIDENTIFIED : INVALID;
        return;
    }
    e->flow = flow_of(e);
    if (!e->map.scaled) {
        absolute_update(e);
    } else if (e->flow.known) {
        scaled_update(e);
    } else {
        set_unknown(output);
    }
    output[HEALTH_STATE] = health_state(e);
}

int estimator_linear_loads(Estimator *e, double dynamic_pressure, double deviation) {
    double kept[N_OUTPUTS];
    memcpy(kept, e->output, sizeof kept);
    const MaskedMap *m = e->masked = masked_map(e);
    e->flow = (Flow){.pressure = dynamic_pressure, .deviation = deviation, .mach_number = NAN, .altitude = NAN};
    e->flow.known = dynamic_pressure >= e->map.min_dynamic_pressure && dynamic_pressure <= e->map.max_dynamic_pressure
                 && deviation >= 0.0 && deviation < INFINITY;
    int found = m->identified && e->flow.known;
    if (found && e->map.scaled) {
        scaled_update(e);
    } else if (found) {
        absolute_update(e);
    }
    for (int i = 0; i < N_LOADS; i++) {
        found = found && isfinite(e->output[COEFFICIENTS + i]);
    }
    const size_t first = found ? HEALTH_STATE : 0;
    memcpy(e->output + first, kept + first, (N_OUTPUTS - first) * sizeof *kept);
    return found;
}

/* The covariance of the errors of the zeros in use; further sensors have none. */
static void set_added_noise(Estimator *e) {
    const size_t n = e->sensors.n_strains, stride = e->map.n_gauges;
    const double common = e->noise_std[n] * e->noise_std[n];
    for (size_t i = 0; i < n; i++) {
        for (size_t j = 0; j < n; j++) {
            e->noise.added[i * stride + j] = common + (i == j ? e->noise_std[i] * e->noise_std[i] : 0.0);
        }
    }
}

/* The matrices for the temperature sensors that are known, and for the deviations of zeros. */
static void renew_noise(Estimator *e, int other_sensors) {
    const size_t n = e->sensors.n_strains;
    const double *std = zeros_in_use(e) + n;
    e->noise_outdated = 0;
    if (other_sensors) {
        thermal_renew(&e->thermal);
        e->noise.own = e->thermal.some ? e->thermal.own : NULL;
        e->noise.whole = e->thermal.some ? e->thermal.noise : NULL;
    } else if (memcmp(e->noise_std, std, (n + 1) * sizeof *std) == 0) {
        return;
    }
    memcpy(e->noise_std, std, (n + 1) * sizeof *std);
    set_added_noise(e);
    memset(e->last_use, 0, sizeof e->last_use);
    e->masked = NULL;
    added_noise_apply(&e->noise, &e->map, &e->cache[0], &e->work);
    if (e->map.scaled) {
        scaled_prepare(e);
    }
    if (e->flight.present) {
        known_forget(e);
        flight_solver_add_noise(&e->flight.solver, e->noise.own, e->noise.added);
    }
}

void estimator_set_strain(Estimator *e) {
    const double *restrict zero = zeros_in_use(e);
    const size_t n = e->sensors.n_strains;
    for (size_t i = 0; i < n; i++) {
        e->strain[i] = e->input[i] - zero[i];
    }
    for (size_t k = 0; k < e->sensors.count; k++) {
        e->strain[n + k] = sensor_reading(e, k) / e->sensors.scale[k];
    }
}

void estimator_before_change(Estimator *e) {
    linear_filter_before_change(e);
    flight_before_change(e);
}

void estimator_follow_tare(Estimator *e) {
    if (e->tare.flags.is_up != 0.0 && !e->tare.up) {
        estimator_before_change(e);
    }
    if (tare_follow(&e->tare, e->map.mean_strain)) {
        e->outdated = e->noise_outdated = 1;
    }
}

void estimator_take_readings(Estimator *e) {
    const double range = e->input[e->map.n_gauges + SENSOR_RANGE];
    if (tare_is_averaging(&e->tare)) {
        for (size_t i = 0; i < e->sensors.n_strains; i++) {
            e->tare.reading[i] = gauge_in_use(e, i, range) ? e->input[i] : NAN;
        }
        tare_take(&e->tare, e->input[e->map.n_gauges + DYNAMIC_PRESSURE]); /* at rest it is 0 */
    }
}

const double *estimator_outputs(Estimator *e) {
    if (e->outdated) {
        const int other_sensors = e->thermal.present && thermal_read(&e->thermal, e->input + first_temperature(e));
        if (e->noise_outdated || other_sensors) {
            renew_noise(e, other_sensors);
        }
        estimator_set_strain(e);
        if (e->thermal.present) {
            thermal_correct(&e->thermal, e->strain);
        }
        if (e->flight.present) {
            flight_update(e);
        } else {
            update(e);
            if (linear_filters(e)) {
                linear_filter_outputs(e);
            }
        }
        e->outdated = 0;
        e->further.outdated = 1;
    }
    return e->output;
}
