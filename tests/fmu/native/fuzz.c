/* Entry of a fuzzer for what comes into the native FMU from outside: map.bin, serialised states, resource locations.

   Built with -fsanitize=fuzzer it is a libFuzzer target; with -DREPLAY it runs the files named on the command line.
   The first byte of an input chooses what is fuzzed (0-2 map, 3-5 state, 6-7 location; -DFUZZ_FIRST and -DFUZZ_LAST
   leave only some of them) and how much is repaired before: without a right checksum and a fitting length nothing
   behind the first check would ever be reached. */

#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/state.h"
#include "core/uri_path.h"
#include "estimator/estimator.h"
#include "estimator/estimator_derivative.h"
#include "estimator/numerics/triangles.h"

#define MOST_GAUGES 64

#ifndef FUZZ_FIRST
#define FUZZ_FIRST 0
#define FUZZ_LAST 7
#endif

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static void put_u32(unsigned char *bytes, size_t position, uint32_t value) {
    memcpy(bytes + position, &value, sizeof value);
}

static void put_u64(unsigned char *bytes, size_t position, uint64_t value) {
    memcpy(bytes + position, &value, sizeof value);
}

/* Arrays of a small map by ascending names. Lengths: n gauges, s states, t values of a triangle, h half-spaces, l layers,
   e error terms, p pairs, figures themselves. Parts: always, s in form "dynamic_pressure", e with errors that follow strain.
   Values: any, + above zero, i whole numbers, x bytes. */
typedef struct {
    const char *name, *lengths;
    char part, values;
} Array;

static const Array ARRAYS[] = {
    {"envelope.altitude", "2", 0, 0},
    {"envelope.direction", "5h", 0, 0},
    {"envelope.dynamic_pressure", "2", 0, 0},
    {"envelope.half_gamma", "", 0, 0},
    {"envelope.layers", "l5", 0, 0},
    {"envelope.limit", "h", 0, 0},
    {"envelope.mach_number", "2", 0, 0},
    {"envelope.pressure_tolerance", "", 0, 0},
    {"envelope.score_limit", "", 0, 0},
    {"guid", "15", 0, 'x'},
    {"linear.ambiguous_correlation", "", 0, 0},
    {"linear.chi_square_limit", "n", 0, 0},
    {"linear.chi_square_scale", "", 0, '+'},
    {"linear.degrees_of_freedom", "", 0, 'i'},
    {"linear.dynamic_pressure_error", "", 0, 0},
    {"linear.gain_triangle", "t", 0, 0},
    {"linear.known_prior", "", 0, 'i'},
    {"linear.load_covariance", "55", 0, 0},
    {"linear.load_gain", "n5", 0, 0},
    {"linear.load_of_mean", "5", 0, 0},
    {"linear.load_per_state", "s5", 0, 0},
    {"linear.max_dynamic_pressure", "", 0, 0},
    {"linear.mean_strain", "n", 0, 0},
    {"linear.min_dynamic_pressure", "", 0, '+'},
    {"linear.min_information", "", 0, 0},
    {"linear.min_precision", "n", 0, 0},
    {"linear.noise_covariance", "nn", 0, 0},
    {"linear.noise_root", "t", 0, 0},
    {"linear.noise_whitening", "t", 0, 0},
    {"linear.outlier_scale", "", 0, '+'},
    {"linear.outlier_threshold", "n", 0, 0},
    {"linear.regression", "5n", 0, 0},
    {"linear.regularisation", "", 0, '+'},
    {"linear.remainder", "55", 0, 0},
    {"linear.residual_triangle", "t", 0, 0},
    {"linear.state_operator", "sn", 0, 0},
    {"scaled.fixed_load", "5", 's', 0},
    {"scaled.fixed_strain", "n", 's', 0},
    {"scaled.gauge_covariance", "nn", 's', 0},
    {"scaled.load_of_mean", "5", 's', 0},
    {"scaled.load_per_direction", "n5", 's', 0},
    {"scaled.mean_strain", "n", 's', 0},
    {"scaled.min_expected_ratio", "", 's', 0},
    {"scaled.min_precision", "n", 's', 0},
    {"scaled.singular_values", "n", 's', 0},
    {"scaled.spread", "nn", 's', 0},
    {"scaled.spread_load", "n5", 's', 0},
    {"scaled.spread_unseen", "55", 's', 0},
    {"scaled.unseen", "55", 's', 0},
    {"scaled.whitening", "nn", 's', 0},
    {"scaled_errors.common", "e6n", 'e', 0},
    {"scaled_errors.mean_product", "p", 'e', 0},
    {"scaled_errors.of_gauge", "pn", 'e', 0},
    {"settings.dynamic_pressure", "", 0, '+'},
    {"settings.largest", "", 0, 0},
    {"settings.largest_zero", "", 0, '+'},
    {"settings.moment_station", "", 0, 0},
    {"settings.not_known", "", 0, 0},
    {"settings.reference_area", "", 0, '+'},
    {"settings.reference_length", "", 0, '+'},
    {"settings.sensor_range", "", 0, '+'},
    {"settings.smallest", "", 0, '+'},
};

#define N_ARRAYS (sizeof ARRAYS / sizeof *ARRAYS)
#define TABLE_AT 48
#define ENTRY_SIZE 80

typedef struct {
    size_t n, states, freedom, prior, scaled, errors, half_spaces, terms, layers;
} Sizes;

static size_t length_of(const Sizes *sizes, char letter) {
    switch (letter) {
    case 'n': return sizes->n;
    case 's': return sizes->states;
    case 't': return sizes->n * (sizes->n + 1) / 2;
    case 'h': return sizes->half_spaces;
    case 'l': return sizes->layers;
    case 'e': return sizes->terms;
    case 'p': return N_PAIRS;
    default: return (size_t)(letter - '0');
    }
}

static int has_array(const Sizes *sizes, const Array *array) {
    return array->part == 0 || (array->part == 's' ? sizes->scaled : sizes->errors);
}

/* Put header and checksum right. */
static void seal(unsigned char *bytes, size_t length) {
    memcpy(bytes, "SFMUMAP", 8);
    put_u32(bytes, 8, MAP_FORMAT_VERSION);
    put_u32(bytes, 12, 0x01020304u);
    put_u64(bytes, 16, length);
    put_u32(bytes, 24, crc32(bytes + 32, length - 32));
}

/* An entry of the table, whose values begin at a position; returns the number of values. */
static size_t put_entry(unsigned char *entry, const Sizes *sizes, const Array *array, size_t position) {
    size_t count = 1, rank = strlen(array->lengths);
    memcpy(entry, array->name, strlen(array->name));
    put_u32(entry, 48, array->values == 'i' ? 1 : array->values == 'x' ? 2 : 0);
    put_u32(entry, 52, (uint32_t)rank);
    for (size_t axis = 0; axis < rank; axis++) {
        const size_t length = length_of(sizes, array->lengths[axis]);
        put_u32(entry, 56 + 4 * axis, (uint32_t)length);
        count *= length;
    }
    put_u64(entry, 72, position);
    return count;
}

/* Values of an array from data; what is not finite becomes 1, or stays. */
static void put_values(unsigned char *values, size_t count, char kind, int finite, const uint8_t **data, size_t *left) {
    for (size_t i = 0; i < count; i++) {
        double value = 0.0;
        const size_t size = *left < sizeof value ? *left : sizeof value;
        memcpy(&value, *data, size);
        *data += size;
        *left -= size;
        if (finite) {
            value = !isfinite(value) ? 1.0 : kind == '+' ? fabs(value) + 1e-9 : value;
        }
        memcpy(values + 8 * i, &value, sizeof value);
    }
}

/* A whole map.bin from whatever there is: sizes made small, length fitted, header and checksum right. Values that are
   not finite become 1, or stay. */
static unsigned char *repaired_map(const uint8_t *data, size_t size, int finite, size_t *length) {
    const size_t bits = size > 3 ? data[3] : 0, scaled = bits >> 1 & 1u, errors = scaled & bits >> 2;
    Sizes sizes = {.n = size > 0 ? 1 + data[0] % 7 : 1, .states = size > 1 ? data[1] % 9 : 0, .prior = bits & 1u};
    sizes.freedom = size > 2 ? 1 + data[2] % sizes.n : 1;
    sizes.scaled = scaled;
    sizes.errors = errors;
    sizes.half_spaces = bits >> 3 & 3u;
    sizes.terms = errors ? bits >> 5 & 3u : 0;
    sizes.layers = 1 + (bits >> 7);
    size_t count = 0, left = size > 4 ? size - 4 : 0;
    for (size_t k = 0; k < N_ARRAYS; k++) {
        count += (size_t)has_array(&sizes, &ARRAYS[k]);
    }
    size_t position = TABLE_AT + count * ENTRY_SIZE;
    unsigned char *bytes = calloc(1, position + N_ARRAYS * (8 * N_PAIRS * 8 + 8 * 3 * 6 * 8));
    if (bytes == NULL) {
        return NULL;
    }
    put_u32(bytes, 32, (uint32_t)count);
    unsigned char *entry = bytes + TABLE_AT;
    data += size - left;
    for (size_t k = 0; k < N_ARRAYS; k++) {
        const Array *array = &ARRAYS[k];
        if (has_array(&sizes, array)) {
            const size_t values = put_entry(entry, &sizes, array, position);
            const size_t each = array->values == 'i' ? 4 : array->values == 'x' ? 1 : 8;
            if (array->values == 'i') {
                const int is_prior = strcmp(array->name, "linear.known_prior") == 0;
                put_u32(bytes, position, (uint32_t)(is_prior ? sizes.prior : sizes.freedom));
            } else if (array->values != 'x') {
                put_values(bytes + position, values, array->values, finite, &data, &left);
            }
            position += (values * each + 15) / 16 * 16;
            entry += ENTRY_SIZE;
        }
    }
    *length = position;
    seal(bytes, position);
    return bytes;
}

/* Set a number of a map. */
static void put_number(unsigned char *bytes, const char *name, double value) {
    unsigned char *entry = bytes + TABLE_AT;
    while (strcmp((const char *)entry, name) != 0) {
        entry += ENTRY_SIZE;
    }
    memcpy(bytes + u32_at(entry, 72), &value, sizeof value);
}

/* Suspects must be there exactly where some z is above the threshold, whatever the result of the screen in float. */
static void check_suspects(const Estimator *e) {
    const MaskedMap *m = e->linear.prepared.masked;
    if (e->map.scaled || !m->identified || !(e->output[CHI_SQUARE] < INFINITY)) {
        return;
    }
    const double scale = e->inputs.value[e->map.n_gauges + ALARM_SCALE] * e->map.outlier_scale;
    const double threshold = sqrt(scale) * m->outlier_threshold;
    int above = 0;
    for (size_t k = 0; k < m->n_used; k++) {
        double z = 0.0;
        for (size_t i = 0; i <= k; i++) {
            z += m->triangle[triangle_column(k) + i] * e->linear.absolute.whitened[i];
        }
        above |= fabs(z * m->z_scale[k]) > threshold;
    }
    if ((e->output[SUSPECTS] > 0.0) != above) {
        abort();
    }
}

/* Steps with every gauge, without some and without any, and a derivative. */
static void use(Estimator *e) {
    char text[MODEL_TEXT_SIZE];
    for (unsigned step = 0; step < 10; step++) {
        for (size_t i = 0; i < e->map.n_gauges; i++) {
            e->inputs.value[i] = step == 3 && i == 1 ? NAN : 1e-4 * (double)((i * 7 + step) % 5);
            e->inputs.given[i] = 1;
            e->inputs.valid[i] = step < 8 ? (unsigned char)((i + step) % 5 != 0) : step == 9;
        }
        e->inputs.n_given = e->map.n_gauges;
        double *scalar = e->inputs.value + e->map.n_gauges;
        scalar[DYNAMIC_PRESSURE] = e->map.dynamic_pressure * (1.0 + 0.4 * step);
        scalar[DYNAMIC_PRESSURE_STD] = step % 3 ? NAN : 0.1 * e->map.dynamic_pressure;
        scalar[MACH_NUMBER] = step % 2 ? NAN : 6.0;
        scalar[ALTITUDE] = step % 4 ? 3e3 * step : NAN;
        if (e->flight.filter.present) { /* off, then on from the fifth step to the last but one */
            e->inputs.value[filter_setting(&e->inputs)] = step < 4 || step == 9 ? 0.0 : 1.0;
        }
        for (size_t t = 0; e->thermal.present && t < e->thermal.map.n_sensors; t++) { /* others read in every third step */
            const int reads = (t + step / 3) % 3 != 0;
            const double reading = e->thermal.map.reference + 3.0 * (double)(t + step);
            e->inputs.value[first_temperature(&e->inputs) + t] = reads ? reading : NAN;
        }
        estimator_before_change(e);
        if (e->flight.present) {
            estimator_step(e, 0.01 * step);
        }
        const int health = (int)estimator_outputs(e)[HEALTH_STATE];
        if (health < OK || health > OUTSIDE) {
            abort();
        }
        check_suspects(e);
        for (size_t i = 0; i < inputs_count(&e->inputs); i++) {
            e->direction[i] = 1.0;
        }
        estimator_derivative(e, e->direction, e->derivative, text);
    }
}

static void fuzz_map(const uint8_t *data, size_t size, int repair) {
    char text[MODEL_TEXT_SIZE];
    size_t length = size;
    unsigned char *bytes;
    if (repair > 0) {
        bytes = repaired_map(data, size, repair > 1, &length);
    } else {
        bytes = malloc(size + 1);
        if (bytes != NULL) {
            memcpy(bytes, data, size);
        }
    }
    Estimator *e = bytes != NULL ? estimator_create(bytes, length, text) : NULL;
    if (e != NULL && e->map.n_gauges <= MOST_GAUGES) {
        use(e);
    }
    estimator_free(e);
}

static void silent(const Instance *instance, int status, const char *category, const char *text) {
    (void)instance;
    (void)status;
    (void)category;
    if (strlen(text) > 4000) {
        abort();
    }
}

/* An instance of a small map of zeros but for what must be positive. */
static Instance *small_instance(void) {
    static const uint8_t SEED[] = {3, 2, 1, 0};
    char text[MODEL_TEXT_SIZE];
    size_t length;
    unsigned char *bytes = repaired_map(SEED, sizeof SEED, 1, &length);
    Instance *instance = calloc(1, sizeof *instance);
    if (bytes == NULL || instance == NULL) {
        abort();
    }
    const double bound = 1e100;
    put_number(bytes, "settings.smallest", bound);
    put_number(bytes, "settings.largest", bound);
    seal(bytes, length);
    instance->model = model_create(bytes, length, text);
    if (instance->model == NULL) {
        abort();
    }
    instance->kind = CO_SIMULATION_2;
    instance->write = silent;
    instance_reset(instance);
    return instance;
}

static void fuzz_state(const uint8_t *data, size_t size, int repair) {
    Instance *instance = small_instance();
    char text[MODEL_TEXT_SIZE];
    unsigned char *bytes = calloc(1, state_size(instance) + size);
    void *state = NULL, *again = NULL;
    if (bytes == NULL) {
        abort();
    }
    memcpy(bytes, data, size);
    if (repair > 0) {
        size = state_size(instance);
        memcpy(bytes, "SFMUSTA", 8);
        put_u32(bytes, 8, 2);
        put_u32(bytes, 16, instance->model->checksum);
        put_u32(bytes, 20, (uint32_t)model_state_size(instance->model));
        if (repair > 1) {
            put_u32(bytes, 28, CO_SIMULATION_2);
        }
        put_u32(bytes, 12, crc32(bytes + 16, size - 16));
    }
    if (state_deserialize(instance, bytes, size, &state) == STATUS_OK) {
        if (state_set(instance, state) != STATUS_OK) {
            abort(); /* what was taken once must be taken again */
        }
        const Selection outputs = {NULL, 0, HEALTH_STATE};
        double value[HEALTH_STATE];
        if (!model_get_reals(instance->model, &outputs, value, text)) {
            abort();
        }
        if (state_get(instance, &again) != STATUS_OK || state_serialize(instance, again, bytes, size) != STATUS_OK) {
            abort();
        }
    }
    state_free(&state);
    state_free(&again);
    free(bytes);
    instance_free(instance);
}

static void fuzz_location(const uint8_t *data, size_t size, int tight) {
    char path[64];
    char *location = malloc(size + 1);
    if (location == NULL) {
        return;
    }
    memcpy(location, data, size);
    location[size] = '\0';
    const size_t room = tight ? 16 : sizeof path;
    if (resource_path(location, "map.bin", path, room) && strlen(path) >= room) {
        abort();
    }
    free(location);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    if (size == 0) {
        return 0;
    }
    const int choice = data[0] % 8;
    if (choice < FUZZ_FIRST || choice > FUZZ_LAST) {
        return 0;
    }
    if (choice < 3) {
        fuzz_map(data + 1, size - 1, choice);
    } else if (choice < 6) {
        fuzz_state(data + 1, size - 1, choice - 3);
    } else {
        fuzz_location(data + 1, size - 1, choice - 6);
    }
    return 0;
}

#ifdef REPLAY
int main(int argc, char **argv) {
    for (int k = 1; k < argc; k++) {
        FILE *file = fopen(argv[k], "rb");
        static uint8_t data[1 << 22];
        if (file == NULL) {
            return 1;
        }
        LLVMFuzzerTestOneInput(data, fread(data, 1, sizeof data, file));
        fclose(file);
    }
    printf("%d inputs\n", argc - 1);
    return 0;
}
#endif
