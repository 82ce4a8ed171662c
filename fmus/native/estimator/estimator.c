#include "estimator.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "panels.h"
#include "suspects.h"
#include "triangles.h"

/* Bytes that vector loads like to start at a multiple of. */
#define ALIGNMENT 64

static const char *const SETTING_NAMES[] = {
    "dynamic_pressure", "dynamic_pressure_std", "sensor_range",    "alarm_scale",
    "reference_area",   "reference_length",     "moment_station",
};

/* One block for all arrays: doubles, then indices, floats and bytes. */
static int allocate(Estimator *e) {
    const Map *map = &e->map;
    const size_t n = map->n_gauges;
    const size_t n_inputs = n + N_SCALAR_INPUTS;
    const size_t n_doubles = CACHED_MASKS * masked_map_doubles(map) + workspace_doubles(map) + 2 * n_inputs + n
                           + 3 * panel_length(n);
    const size_t n_indices = CACHED_MASKS * masked_map_indices(map) + n;
    const size_t n_bytes = n_doubles * sizeof(double) + n_indices * sizeof(size_t) + n * sizeof(float);
    e->memory = calloc(1, ALIGNMENT + n_bytes + (CACHED_MASKS + 2) * n);
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
    workspace_arrays(map, &e->work, &doubles, &indices);
    e->input = doubles;
    e->residual = e->input + n_inputs;
    e->z = e->residual + n;
    e->whitened = e->z + panel_length(n);
    e->d_whitened = e->whitened + panel_length(n);
    e->direction = e->d_whitened + panel_length(n);
    e->valid = flags + CACHED_MASKS * n;
    e->mask = e->valid + n;
    return 1;
}

Estimator *estimator_create(unsigned char *bytes, size_t length, char text[MODEL_TEXT_SIZE]) {
    Estimator *e = calloc(1, sizeof *e);
    if (e == NULL) {
        snprintf(text, MODEL_TEXT_SIZE, "needs more memory than there is");
        free(bytes);
        return NULL;
    }
    e->bytes = bytes;
    if (!map_parse(bytes, length, &e->map, text)) {
        estimator_free(e);
        return NULL;
    }
    if (!allocate(e)) {
        snprintf(text, MODEL_TEXT_SIZE, "needs more memory than there is");
        estimator_free(e);
        return NULL;
    }
    e->wide = panels_wide();
    estimator_reset(e);
    return e;
}

void estimator_free(Estimator *e) {
    if (e != NULL) {
        free(e->memory);
        free(e->bytes);
        free(e);
    }
}

void estimator_reset(Estimator *e) {
    const size_t n = e->map.n_gauges;
    double *scalar = e->input + n;
    memset(e->input, 0, n * sizeof *e->input);
    memset(e->valid, 1, n);
    scalar[DYNAMIC_PRESSURE] = e->map.dynamic_pressure;
    scalar[DYNAMIC_PRESSURE_STD] = 0.0;
    scalar[SENSOR_RANGE] = e->map.sensor_range;
    scalar[ALARM_SCALE] = 1.0;
    scalar[REFERENCE_AREA] = e->map.reference_area;
    scalar[REFERENCE_LENGTH] = e->map.reference_length;
    scalar[MOMENT_STATION] = e->map.moment_station;
    e->outdated = 1;
}

int estimator_accepts(const Estimator *e, size_t index, double value, char text[MODEL_TEXT_SIZE]) {
    if (index < e->map.n_gauges + SENSOR_RANGE) {
        return 1;
    }
    const size_t setting = index - e->map.n_gauges;
    const double largest = setting == SENSOR_RANGE ? e->map.largest_sensor_range : e->map.largest_setting;
    if (setting == MOMENT_STATION) {
        if (fabs(value) <= largest) {
            return 1;
        }
        snprintf(text, MODEL_TEXT_SIZE, "%s: %g found, must be between %g and %g", SETTING_NAMES[setting], value,
                 -largest, largest);
        return 0;
    }
    if (value > 0.0 && value <= largest) {
        return 1;
    }
    snprintf(text, MODEL_TEXT_SIZE, "%s: %g found, must be positive and at most %g", SETTING_NAMES[setting], value,
             largest);
    return 0;
}

/* Whether a gauge is in use: the caller trusts it, and its strain is a number within the sensor range. */
static inline unsigned char in_use(const Estimator *e, size_t i, double range) {
    return (unsigned char)(e->valid[i] & (fabs(e->input[i]) <= range));
}

/* Whether the gauges in use are those of e->masked. */
static int same_mask(const Estimator *e, double range) {
    const size_t n = e->map.n_gauges;
    if (e->masked == NULL) {
        return 0;
    }
    int broken = 0;
    for (size_t i = 0; i < n; i++) {
        broken |= !(fabs(e->input[i]) <= range);
    }
    if (!broken) {
        return memcmp(e->masked->mask, e->valid, n) == 0;
    }
    int changed = 0;
    for (size_t i = 0; i < n; i++) {
        changed |= e->masked->mask[i] ^ in_use(e, i, range);
    }
    return !changed;
}

/* The matrices for the gauges in use: those of the step before, or from the cache if they are there. */
static MaskedMap *masked_map(Estimator *e) {
    const size_t n = e->map.n_gauges;
    const double range = e->input[n + SENSOR_RANGE];
    if (same_mask(e, range)) {
        return e->masked;
    }
    for (size_t i = 0; i < n; i++) {
        e->mask[i] = in_use(e, i, range);
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

/* Factors of coefficients: 1 / (q S) for the three forces, 1 / (q S L) for the two moments. */
static void coefficient_scales(const double *scalar, double *scale) {
    const double area = scalar[REFERENCE_AREA];
    scale[0] = scale[1] = scale[2] = 1.0 / (scalar[DYNAMIC_PRESSURE] * area);
    scale[3] = scale[4] = 1.0 / (scalar[DYNAMIC_PRESSURE] * (area * scalar[REFERENCE_LENGTH]));
}

/* No number, for outputs from `first` up to, not including, `end`. */
static void set_unknown(double *output, int first, int end) {
    for (int i = first; i < end; i++) {
        output[i] = NAN;
    }
}

/* Sum of the gains of the gauges in use, weighted with x: loads that strains x stand for. */
static void gain_times(const MaskedMap *m, const double *restrict x, double *restrict loads) {
    double even[LOAD_STRIDE] = {0.0}, odd[LOAD_STRIDE] = {0.0};
    size_t k = 0;
    for (; k + 2 <= m->n_used; k += 2) {
        const double *restrict gain = m->load_gain + LOAD_STRIDE * k;
        for (size_t i = 0; i < LOAD_STRIDE; i++) {
            even[i] += gain[i] * x[k];
            odd[i] += gain[i + LOAD_STRIDE] * x[k + 1];
        }
    }
    if (k < m->n_used) {
        for (size_t i = 0; i < LOAD_STRIDE; i++) {
            even[i] += m->load_gain[LOAD_STRIDE * k + i] * x[k];
        }
    }
    for (size_t i = 0; i < N_LOADS; i++) {
        loads[i] = even[i] + odd[i];
    }
}

/* M_P' = M_P + shift F_N and M_Y' = M_Y + shift F_Y about a point further aft. */
static void move_moments(double shift, double *loads) {
    loads[3] += shift * loads[1];
    loads[4] += shift * loads[2];
}

static double moment_shift(const Estimator *e) {
    return e->input[e->map.n_gauges + MOMENT_STATION] - e->map.moment_station;
}

/* Variance of moment `load` about the shifted point, and in *with_force its covariance with the force that comes in:
   of B C B' the entries that are needed. */
static double moved_variance(const double *covariance, size_t load, double shift, double *with_force) {
    const size_t force = load - 2;
    const double cross = covariance[load * N_LOADS + force], of_force = covariance[force * N_LOADS + force];
    *with_force = cross + shift * of_force;
    return (covariance[load * N_LOADS + load] + shift * cross) + shift * *with_force;
}

/* Deviations of the loads, which change only with the gauges in use and the moment point. */
static void set_load_std(MaskedMap *m, double shift) {
    for (size_t i = 0; i < N_LOADS; i++) {
        double with_force;
        const double variance =
            i < 3 ? m->load_covariance[i * N_LOADS + i] : moved_variance(m->load_covariance, i, shift, &with_force);
        m->load_std[i] = sqrt(variance);
    }
    m->load_std_shift = shift;
}

static void set_loads(const Estimator *e, double *output) {
    MaskedMap *m = e->masked;
    const double shift = moment_shift(e);
    if (shift != m->load_std_shift) {
        set_load_std(m, shift);
    }
    gain_times(m, e->residual, output + LOADS);
    for (size_t i = 0; i < N_LOADS; i++) {
        output[LOADS + i] += e->map.load_of_mean[i];
    }
    move_moments(shift, output + LOADS);
    memcpy(output + LOADS_STD, m->load_std, sizeof m->load_std);
}

/* Whether the dynamic pressure gives coefficients; if so, set them. */
static int set_coefficients(const Estimator *e, double *output) {
    const double *scalar = e->input + e->map.n_gauges;
    const double pressure = scalar[DYNAMIC_PRESSURE], deviation = scalar[DYNAMIC_PRESSURE_STD];
    const int usable = pressure >= e->map.min_dynamic_pressure && pressure < INFINITY && deviation >= 0.0
                    && deviation < INFINITY;
    if (!usable) {
        set_unknown(output, COEFFICIENTS, LOADS);
        return 0;
    }
    const double fraction = deviation / pressure;
    double scale[N_LOADS];
    coefficient_scales(scalar, scale);
    for (size_t i = 0; i < N_LOADS; i++) {
        const double coefficient = scale[i] * output[LOADS + i], of_loads = scale[i] * output[LOADS_STD + i];
        const double of_pressure = coefficient * fraction;
        output[COEFFICIENTS + i] = coefficient;
        output[COEFFICIENTS_STD + i] =
            deviation > 0.0 ? sqrt(of_loads * of_loads + of_pressure * of_pressure) : of_loads;
    }
    return 1;
}

static int health_state(const Estimator *e, const double *output) {
    if (output[CHI_SQUARE] > output[CHI_SQUARE_LIMIT]) {
        return INCONSISTENT;
    }
    if (output[SUSPECTS] > 0.0) {
        return SUSPECT;
    }
    return e->masked->n_used == e->map.n_gauges ? OK : DEGRADED;
}

/* What the strains in use differ by from those of the mean state. */
static void set_residual(Estimator *e) {
    const MaskedMap *m = e->masked;
    if (m->n_used == e->map.n_gauges) {
        for (size_t k = 0; k < m->n_used; k++) {
            e->residual[k] = e->input[k] - m->mean_strain[k];
        }
        return;
    }
    for (size_t k = 0; k < m->n_used; k++) {
        e->residual[k] = e->input[m->used[k]] - m->mean_strain[k];
    }
}

static void update(Estimator *e) {
    double *output = e->output;
    const MaskedMap *m = e->masked = masked_map(e);
    output[VALID_GAUGES] = (double)m->n_used;
    output[SUSPECT_GAUGE] = output[SUSPECTS] = 0.0;
    if (!m->identified) {
        set_unknown(output, COEFFICIENTS, HEALTH_STATE);
        set_unknown(output, CHI_SQUARE, VALID_GAUGES);
        output[HEALTH_STATE] = m->n_used > 0 ? UNIDENTIFIED : INVALID;
        return;
    }
    set_residual(e);
    const double alarm_scale = e->input[e->map.n_gauges + ALARM_SCALE];
    panels_times(e->wide, m->n_used, m->row_panels, e->residual, e->whitened);
    output[CHI_SQUARE] = dot(m->n_used, e->whitened, e->whitened);
    output[CHI_SQUARE_LIMIT] = alarm_scale * m->chi_square_limit;
    set_suspects(e, alarm_scale);
    set_loads(e, output);
    output[HEALTH_STATE] = set_coefficients(e, output) ? health_state(e, output) : NO_COEFFICIENTS;
}

const double *estimator_outputs(Estimator *e) {
    if (e->outdated) {
        update(e);
        e->outdated = 0;
    }
    return e->output;
}

/* Derivatives of loads, their deviations and chi-square; d_residual is that of the strains in use. */
static void derive_loads(Estimator *e, const double *d_residual, double d_shift, double *d_output) {
    const MaskedMap *m = e->masked;
    const double shift = moment_shift(e);
    gain_times(m, d_residual, d_output + LOADS);
    move_moments(shift, d_output + LOADS);
    for (size_t i = 3; i < N_LOADS; i++) {
        double with_force;
        const double variance = moved_variance(m->load_covariance, i, shift, &with_force);
        d_output[LOADS + i] += d_shift * e->output[LOADS + i - 2];
        d_output[LOADS_STD + i] = with_force * d_shift / sqrt(variance);
    }
    /* d|W r|^2 = 2 (W r)' W dr. */
    panels_times(e->wide, m->n_used, m->row_panels, d_residual, e->d_whitened);
    d_output[CHI_SQUARE] = 2.0 * dot(m->n_used, e->whitened, e->d_whitened);
}

static void derive_coefficients(const Estimator *e, const double *d_scalar, double *d_output) {
    const double *scalar = e->input + e->map.n_gauges, *output = e->output;
    const double pressure = scalar[DYNAMIC_PRESSURE];
    const double fraction = scalar[DYNAMIC_PRESSURE_STD] / pressure;
    const double d_fraction = (d_scalar[DYNAMIC_PRESSURE_STD] - fraction * d_scalar[DYNAMIC_PRESSURE]) / pressure;
    double scales[N_LOADS];
    coefficient_scales(scalar, scales);
    for (size_t i = 0; i < N_LOADS; i++) {
        const double scale = scales[i];
        double growth = d_scalar[DYNAMIC_PRESSURE] / pressure + d_scalar[REFERENCE_AREA] / scalar[REFERENCE_AREA];
        growth += i < 3 ? 0.0 : d_scalar[REFERENCE_LENGTH] / scalar[REFERENCE_LENGTH];
        const double coefficient = output[COEFFICIENTS + i];
        const double derivative = scale * d_output[LOADS + i] - coefficient * growth;
        const double of_loads = scale * output[LOADS_STD + i], of_pressure = coefficient * fraction;
        const double d_of_loads = scale * d_output[LOADS_STD + i] - of_loads * growth;
        const double d_of_pressure = derivative * fraction + coefficient * d_fraction;
        d_output[COEFFICIENTS + i] = derivative;
        d_output[COEFFICIENTS_STD + i] =
            (of_loads * d_of_loads + of_pressure * d_of_pressure) / output[COEFFICIENTS_STD + i];
    }
}

void estimator_derivative(Estimator *e, const double *d_input, double d_output[N_OUTPUTS]) {
    const double *output = estimator_outputs(e), *d_scalar = d_input + e->map.n_gauges;
    const MaskedMap *m = e->masked;
    memset(d_output, 0, N_OUTPUTS * sizeof *d_output);
    if (!m->identified) {
        set_unknown(d_output, COEFFICIENTS, HEALTH_STATE);
        set_unknown(d_output, CHI_SQUARE, VALID_GAUGES);
        return;
    }
    for (size_t k = 0; k < m->n_used; k++) {
        e->residual[k] = d_input[m->used[k]];
    }
    derive_loads(e, e->residual, d_scalar[MOMENT_STATION], d_output);
    if (d_scalar[ALARM_SCALE] != 0.0) { /* the limit may be infinite */
        d_output[CHI_SQUARE_LIMIT] = d_scalar[ALARM_SCALE] * m->chi_square_limit;
    }
    if (isnan(output[COEFFICIENTS])) {
        set_unknown(d_output, COEFFICIENTS, LOADS);
    } else {
        derive_coefficients(e, d_scalar, d_output);
    }
}
