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

#define VALUES_AT (HEADER_SIZE + 4 * N_SIZES)
#define N_SCALARS 27

/* Whether a scalar of the map must be positive. */
static int is_positive(size_t scalar) {
    static const unsigned char POSITIVE[] = {0, 1, 3, 4, 7, 8, 12, 13, 25, 26};
    return memchr(POSITIVE, (int)scalar, sizeof POSITIVE) != NULL;
}

/* A whole map.bin from whatever there is: sizes made small, length fitted, header and checksum right. Values that are
   not finite become 1, or stay. */
static unsigned char *repaired_map(const uint8_t *data, size_t size, int finite, size_t *length) {
    const size_t n = size > 0 ? 1 + data[0] % 7 : 1, states = size > 1 ? data[1] % 9 : 0;
    const size_t freedom = size > 2 ? 1 + data[2] % n : 1, bits = size > 3 ? data[3] : 0;
    const size_t prior = bits & 1u, scaled = bits >> 1 & 1u, errors = scaled & bits >> 2, half_spaces = bits >> 3 & 3u;
    const size_t terms = errors ? bits >> 5 & 3u : 0, layers = 1 + (bits >> 7);
    const size_t triangle = n * (n + 1) / 2;
    size_t doubles = N_SCALARS + n + 5 + 5 * n + 25 + 4 * triangle + 5 * n + 25 + states * n + 5 * states + 3 * n + n * n;
    doubles += LAYER_SIZE * layers + 6 * half_spaces + scaled * (n * n + n + 5 * n + 25 + 2 * n + 10 + n + 2 * n * n + 5 * n + 25);
    doubles += errors * (21 * n + 21 + 6 * terms * n);
    *length = VALUES_AT + 8 * doubles;
    unsigned char *bytes = calloc(1, *length);
    if (bytes == NULL) {
        return NULL;
    }
    const size_t rest = size > 4 ? size - 4 : 0, room = *length - VALUES_AT;
    memcpy(bytes + VALUES_AT, data + size - rest, rest < room ? rest : room);
    for (size_t i = 0; finite && i < doubles; i++) {
        double value;
        memcpy(&value, bytes + VALUES_AT + 8 * i, 8);
        value = !isfinite(value) ? 1.0 : is_positive(i) ? fabs(value) + 1e-9 : value;
        memcpy(bytes + VALUES_AT + 8 * i, &value, 8);
    }
    const size_t sizes[N_SIZES] = {scaled, scaled && !prior ? n - freedom : 0, half_spaces, layers, errors, terms};
    for (size_t k = 0; k < N_SIZES; k++) {
        put_u32(bytes, HEADER_SIZE + 4 * k, (uint32_t)sizes[k]);
    }
    memcpy(bytes, "SFMUMAP", 8);
    put_u32(bytes, 8, MAP_FORMAT_VERSION);
    put_u32(bytes, 12, 0x01020304u);
    put_u64(bytes, 16, *length);
    put_u32(bytes, 32, (uint32_t)n);
    put_u32(bytes, 36, (uint32_t)states);
    put_u32(bytes, 40, (uint32_t)freedom);
    put_u32(bytes, 44, (uint32_t)prior);
    put_u32(bytes, 24, crc32(bytes + 32, *length - 32));
    return bytes;
}

/* Suspects must be there exactly where some z is above the threshold, whatever the result of the screen in float. */
static void check_suspects(const Estimator *e) {
    const MaskedMap *m = e->masked;
    if (e->map.scaled || !m->identified || !(e->output[CHI_SQUARE] < INFINITY)) {
        return;
    }
    const double scale = e->input[e->map.n_gauges + ALARM_SCALE] * e->map.outlier_scale;
    const double threshold = sqrt(scale) * m->outlier_threshold;
    int above = 0;
    for (size_t k = 0; k < m->n_used; k++) {
        double z = 0.0;
        for (size_t i = 0; i <= k; i++) {
            z += m->triangle[triangle_column(k) + i] * e->whitened[i];
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
            e->input[i] = step == 3 && i == 1 ? NAN : 1e-4 * (double)((i * 7 + step) % 5);
            e->given[i] = 1;
            e->valid[i] = step < 8 ? (unsigned char)((i + step) % 5 != 0) : step == 9;
        }
        e->n_given = e->map.n_gauges;
        double *scalar = e->input + e->map.n_gauges;
        scalar[DYNAMIC_PRESSURE] = e->map.dynamic_pressure * (1.0 + 0.4 * step);
        scalar[DYNAMIC_PRESSURE_STD] = step % 3 ? NAN : 0.1 * e->map.dynamic_pressure;
        scalar[MACH_NUMBER] = step % 2 ? NAN : 6.0;
        scalar[ALTITUDE] = step % 4 ? 3e3 * step : NAN;
        if (e->flight.filter.present) { /* off, then on from the fifth step to the last but one */
            e->input[filter_setting(e)] = step < 4 || step == 9 ? 0.0 : 1.0;
        }
        for (size_t t = 0; e->thermal.present && t < e->thermal.map.n_sensors; t++) { /* others read in every third step */
            const int reads = (t + step / 3) % 3 != 0;
            e->input[first_temperature(e) + t] = reads ? e->thermal.map.reference + 3.0 * (double)(t + step) : NAN;
        }
        flight_before_change(e);
        if (e->flight.present) {
            flight_step(e, 0.01 * step);
        }
        const int health = (int)estimator_outputs(e)[HEALTH_STATE];
        if (health < OK || health > OUTSIDE) {
            abort();
        }
        check_suspects(e);
        for (size_t i = 0; i < estimator_inputs(e); i++) {
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
    double bound = 1e100;
    memcpy(bytes + VALUES_AT + 64, &bound, 8);
    memcpy(bytes + VALUES_AT + 72, &bound, 8);
    put_u32(bytes, 24, crc32(bytes + 32, length - 32));
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
