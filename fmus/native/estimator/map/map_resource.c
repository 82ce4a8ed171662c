#include "map_resource.h"

#include <float.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#define N_SCALARS 27
#define MAX_COUNT 4096
#define MAX_HALF_SPACES 65536
#define VALUES_AT (HEADER_SIZE + 4 * N_SIZES)

/* Places of the form, 0 or 1, and of the sizes that follow the header. */
enum { FORM, N_FREE, N_HALF_SPACES, N_LAYERS, HAS_ERRORS, N_TERMS, N_SECTIONS };

static const char MAGIC[8] = "SFMUMAP";

static uint32_t size_at(const unsigned char *bytes, int place) {
    return u32_at(bytes, HEADER_SIZE + 4 * (size_t)place);
}

static size_t number_of_doubles(const unsigned char *bytes) {
    const size_t n = u32_at(bytes, 32), states = u32_at(bytes, 36), loads = N_LOADS, triangle = n * (n + 1) / 2;
    size_t count = N_SCALARS + n + loads + loads * n + loads * loads + 4 * triangle + loads * n + loads * loads
                 + states * n + states * loads + 3 * n + n * n + LAYER_SIZE * size_at(bytes, N_LAYERS)
                 + (1 + loads) * size_at(bytes, N_HALF_SPACES);
    if (size_at(bytes, FORM)) {
        count += n * n + n + loads * n + loads * loads + 2 * n + 2 * loads + n;
        count += 2 * n * n + loads * n + loads * loads;
        count += size_at(bytes, HAS_ERRORS) ? N_PAIRS * n + N_PAIRS + 6 * size_at(bytes, N_TERMS) * n : 0;
    }
    return count;
}

/* Whether what follows the header is what a map of the form can have. */
static int sensible_sizes(const unsigned char *bytes) {
    const uint32_t n = u32_at(bytes, 32), freedom = u32_at(bytes, 40), known_prior = u32_at(bytes, 44);
    const uint32_t scaled = size_at(bytes, FORM), errors = size_at(bytes, HAS_ERRORS), terms = size_at(bytes, N_TERMS);
    const uint32_t n_free = size_at(bytes, N_FREE);
    return scaled <= 1 && errors <= scaled && terms <= (errors ? MAX_COUNT : 0) && size_at(bytes, N_SECTIONS) <= N_SECTION_KINDS
        && size_at(bytes, 7) == 0 && n_free == (scaled && !known_prior ? n - freedom : 0)
        && size_at(bytes, N_HALF_SPACES) <= MAX_HALF_SPACES && size_at(bytes, N_LAYERS) >= 1
        && size_at(bytes, N_LAYERS) <= MAX_COUNT;
}

static int check_sizes(const unsigned char *bytes, size_t length, char *text) {
    if (length < VALUES_AT) {
        snprintf(text, MODEL_TEXT_SIZE, "has %lu bytes, which is too few for a map", (unsigned long)length);
        return 0;
    }
    const uint32_t n = u32_at(bytes, 32), states = u32_at(bytes, 36);
    const uint32_t freedom = u32_at(bytes, 40), known_prior = u32_at(bytes, 44);
    if (n < 1 || n > MAX_COUNT || states > MAX_COUNT || freedom < 1 || freedom > n || known_prior > 1) {
        snprintf(text, MODEL_TEXT_SIZE, "is for %lu gauges, %lu states, %lu degrees of freedom, which cannot be",
                 (unsigned long)n, (unsigned long)states, (unsigned long)freedom);
        return 0;
    }
    if (!sensible_sizes(bytes)) {
        snprintf(text, MODEL_TEXT_SIZE, "is of form %lu with %lu free states, %lu half-spaces, %lu layers of air, %lu error "
                 "terms, which cannot be", (unsigned long)size_at(bytes, FORM), (unsigned long)size_at(bytes, N_FREE),
                 (unsigned long)size_at(bytes, N_HALF_SPACES), (unsigned long)size_at(bytes, N_LAYERS),
                 (unsigned long)size_at(bytes, N_TERMS));
        return 0;
    }
    const size_t end = VALUES_AT + 8 * number_of_doubles(bytes);
    if (size_at(bytes, N_SECTIONS) ? length <= end : length != end) {
        snprintf(text, MODEL_TEXT_SIZE, "has %lu bytes, which is wrong for %lu gauges and %lu states",
                 (unsigned long)length, (unsigned long)n, (unsigned long)states);
        return 0;
    }
    if (memchr(bytes + 48, '\0', HEADER_SIZE - 48) == NULL) {
        snprintf(text, MODEL_TEXT_SIZE, "holds a guid without an end");
        return 0;
    }
    return 1;
}

static int check_values(const Map *map, const double *values, size_t count, char *text) {
    for (size_t i = 0; i < count; i++) {
        if (!isfinite(values[i])) {
            snprintf(text, MODEL_TEXT_SIZE, "holds a value that is not finite (number %lu)", (unsigned long)i);
            return 0;
        }
    }
    const int positive = map->reference_area > 0.0 && map->reference_length > 0.0 && map->sensor_range > 0.0
                      && map->dynamic_pressure > 0.0 && map->min_dynamic_pressure > 0.0
                      && map->regularisation >= 0.0 && map->chi_square_scale > 0.0 && map->outlier_scale > 0.0
                      && map->smallest_setting > 0.0;
    if (!positive) {
        snprintf(text, MODEL_TEXT_SIZE, "holds a reference quantity that is not positive");
    }
    return positive;
}

/* A bound; those that a map does not state are the largest numbers of the file, which holds finite ones alone. */
static double bound(double value) {
    return fabs(value) < DBL_MAX ? value : copysign(INFINITY, value);
}

/* From the eleventh scalar on. */
static void take_limits(Map *map, const double *scalars) {
    Envelope *envelope = &map->envelope;
    map->max_dynamic_pressure = scalars[0];
    map->dynamic_pressure_error = scalars[1];
    map->chi_square_scale = scalars[2];
    map->outlier_scale = scalars[3];
    envelope->score_limit = scalars[4];
    for (int i = 0; i < 2; i++) {
        envelope->dynamic_pressure[i] = bound(scalars[5 + i]);
        envelope->mach_number[i] = bound(scalars[7 + i]);
        envelope->altitude[i] = bound(scalars[9 + i]);
    }
    envelope->half_gamma = scalars[11];
    envelope->pressure_tolerance = scalars[12];
    map->form.min_expected_ratio = scalars[13];
    map->not_known = scalars[14];
    map->regularisation = scalars[15];
    map->largest_zero = scalars[16];
}

static void take_form(Map *map, const double **next) {
    const size_t n = map->n_gauges;
    ScaledForm *form = &map->form;
    form->whitening = take_doubles(next, n * n);
    form->singular = take_doubles(next, n);
    form->load = take_doubles(next, N_LOADS * n);
    form->unseen = take_doubles(next, N_LOADS * N_LOADS);
    form->fixed_strain = take_doubles(next, n);
    form->mean_strain = take_doubles(next, n);
    form->fixed_load = take_doubles(next, N_LOADS);
    form->load_of_mean = take_doubles(next, N_LOADS);
    form->min_precision = take_doubles(next, n);
    form->gauge_covariance = take_doubles(next, n * n);
    form->spread = take_doubles(next, n * n);
    form->spread_load = take_doubles(next, N_LOADS * n);
    form->spread_unseen = take_doubles(next, N_LOADS * N_LOADS);
    if (form->has_errors) {
        form->of_gauge = take_doubles(next, N_PAIRS * n);
        form->mean_product = take_doubles(next, N_PAIRS);
        form->common = take_doubles(next, 6 * form->n_terms * n);
    }
}

static void take_arrays(Map *map, const double *next) {
    const size_t n = map->n_gauges, states = map->n_states, triangle = n * (n + 1) / 2;
    const double *scalars = take_doubles(&next, N_SCALARS);
    map->reference_area = scalars[0];
    map->reference_length = scalars[1];
    map->moment_station = scalars[2];
    map->sensor_range = scalars[3];
    map->dynamic_pressure = scalars[4];
    map->min_information = scalars[5];
    map->ambiguous_correlation = scalars[6];
    map->min_dynamic_pressure = scalars[7];
    map->smallest_setting = scalars[8];
    map->largest_setting = scalars[9];
    map->mean_strain = take_doubles(&next, n);
    map->load_of_mean = take_doubles(&next, N_LOADS);
    map->load_gain = take_doubles(&next, N_LOADS * n);
    map->load_covariance = take_doubles(&next, N_LOADS * N_LOADS);
    map->residual_triangle = take_doubles(&next, triangle);
    map->gain_triangle = take_doubles(&next, triangle);
    map->noise_whitening = take_doubles(&next, triangle);
    map->noise_root = take_doubles(&next, triangle);
    map->regression = take_doubles(&next, N_LOADS * n);
    map->remainder = take_doubles(&next, N_LOADS * N_LOADS);
    map->state_operator = take_doubles(&next, states * n);
    map->load_per_state = take_doubles(&next, states * N_LOADS);
    map->min_precision = take_doubles(&next, n);
    map->chi_square_limit = take_doubles(&next, n);
    map->outlier_threshold = take_doubles(&next, n);
    map->noise_covariance = take_doubles(&next, n * n);
    take_limits(map, scalars + 10);
    map->envelope.atmosphere.layer = take_doubles(&next, LAYER_SIZE * map->envelope.atmosphere.n_layers);
    map->envelope.limit = take_doubles(&next, map->envelope.n_half_spaces);
    map->envelope.direction = take_doubles(&next, N_LOADS * map->envelope.n_half_spaces);
    if (map->scaled) {
        take_form(map, &next);
    }
}

int map_parse(const unsigned char *bytes, size_t length, Map *map, char text[MODEL_TEXT_SIZE]) {
    if (!resource_check(bytes, length, MAGIC, MAP_FORMAT_VERSION, "map", text) || !check_sizes(bytes, length, text)) {
        return 0;
    }
    map->n_gauges = u32_at(bytes, 32);
    map->n_states = u32_at(bytes, 36);
    map->degrees_of_freedom = (int)u32_at(bytes, 40);
    map->known_prior = (int)u32_at(bytes, 44);
    map->checksum = u32_at(bytes, CHECKSUM_AT);
    map->guid = (const char *)bytes + 48;
    map->scaled = (int)size_at(bytes, FORM);
    map->form.n_free = size_at(bytes, N_FREE);
    map->form.has_errors = (int)size_at(bytes, HAS_ERRORS);
    map->form.n_terms = size_at(bytes, N_TERMS);
    map->envelope.n_half_spaces = size_at(bytes, N_HALF_SPACES);
    map->envelope.atmosphere.n_layers = size_at(bytes, N_LAYERS);
    const double *values = (const double *)(const void *)(bytes + VALUES_AT);
    const size_t end = VALUES_AT + 8 * number_of_doubles(bytes);
    take_arrays(map, values);
    return sections_find(bytes + end, length - end, size_at(bytes, N_SECTIONS), map->section, text)
        && check_values(map, values, number_of_doubles(bytes), text);
}
