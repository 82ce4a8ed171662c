/* Entry of a fuzzer for what comes into the compiled estimator from outside: map.bin, serialised states, resource
   locations, and samples, settings and tares by strainload.h.

     fuzz MAP inputs FILE...        run the inputs in files
     fuzz MAP flips COUNT SEED      open and use COUNT copies of the map with some bits flipped, checksum put right
     fuzz MAP allocations COUNT SEED   open it with every single allocation failing, then COUNT times random ones

   MAP is a map.bin that is right, which inputs change: the program has no layout of its own that could be an old one.
   Built with -fsanitize=fuzzer -DLIBFUZZER it is a libFuzzer target, and FUZZ_MAP in the environment names the map.
   The first byte of an input chooses what is fuzzed, see LLVMFuzzerTestOneInput. Checksums of what was changed are put
   right: behind a wrong one nothing would ever be reached. Link with -Wl,--wrap=malloc,--wrap=calloc. */

#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/instance.h"
#include "core/resource.h"
#include "core/state.h"
#include "core/uri_path.h"
#include "estimator/estimator.h"
#include "estimator/interface/strainload.h"

#define MOST_GAUGES 64
#define CHECKED_FROM 32 /* of a map; of a state 16 */
#define N_CHOICES 8

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static unsigned char *whole_map; /* a map that is right */
static size_t whole_length;

/* --- allocations that fail -------------------------------------------------------------------------------------- */

static long allocation, failing = -1; /* number of the next one, and of the one that fails */
static uint64_t failing_random;       /* state of a generator by which one of 8 fails; 0 for none */

void *__real_malloc(size_t size);
void *__real_calloc(size_t count, size_t size);
void *__wrap_malloc(size_t size);
void *__wrap_calloc(size_t count, size_t size);

/* Uniform whole numbers: splitmix64. */
static uint64_t random_of(uint64_t *state) {
    uint64_t z = (*state += 0x9E3779B97F4A7C15u);
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9u;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBu;
    return z ^ (z >> 31);
}

static int fails(void) {
    const int by_chance = failing_random != 0 && random_of(&failing_random) % 8 == 0;
    return allocation++ == failing || by_chance;
}

void *__wrap_malloc(size_t size) {
    return fails() ? NULL : __real_malloc(size);
}

void *__wrap_calloc(size_t count, size_t size) {
    return fails() ? NULL : __real_calloc(count, size);
}

static void *copy_of(const void *bytes, size_t length) {
    void *copy = malloc(length > 0 ? length : 1);
    if (copy == NULL) {
        abort();
    }
    memcpy(copy, bytes, length);
    return copy;
}

/* --- changes ------------------------------------------------------------------------------------------------------ */

typedef struct {
    const uint8_t *data;
    size_t left;
} Input;

/* The next bytes of an input; zeros behind its end. */
static void take(Input *input, void *value, size_t size) {
    const size_t there = size < input->left ? size : input->left;
    memset(value, 0, size);
    memcpy(value, input->data, there);
    input->data += there;
    input->left -= there;
}

static unsigned take_byte(Input *input) {
    unsigned char value;
    take(input, &value, 1);
    return value;
}

/* A number: one that is often a border, or any bits. */
static double take_number(Input *input) {
    static const double BORDERS[] = {0.0,  -0.0,  1.0,   -1.0,   NAN,      INFINITY, -INFINITY, 1e308,
                                     -1e308, 1e-308, 5e-324, 1e-9, 4294967296.0, 1e100,    64.0,      3.0};
    const unsigned kind = take_byte(input);
    double value;
    if (kind < 128) {
        return BORDERS[kind % 16];
    }
    take(input, &value, sizeof value);
    return kind < 192 ? 1e-6 * (double)(kind - 160) : value;
}

static void put_u32(unsigned char *bytes, size_t position, uint32_t value) {
    memcpy(bytes + position, &value, sizeof value);
}

/* Change bytes [length] from a position on: a double, a number of four bytes, or a byte, in their usual places. */
static void change(unsigned char *bytes, size_t length, size_t from, Input *input, int finite) {
    const unsigned kind = take_byte(input) % 4;
    const size_t unit = kind < 2 ? sizeof(double) : kind == 2 ? sizeof(uint32_t) : 1;
    uint32_t place;
    take(input, &place, sizeof place);
    if (length - from < unit) {
        return;
    }
    unsigned char *at = bytes + from + (place % ((length - from) / unit)) * unit;
    if (kind < 2) {
        const double value = take_number(input);
        if (isfinite(value) || !finite) {
            memcpy(at, &value, sizeof value);
        }
    } else {
        take(input, at, unit);
    }
}

/* Where the values of one of the arrays of the map lie, and how many bytes they take. */
static size_t array_place(const unsigned char *bytes, size_t length, size_t k, size_t *size) {
    const size_t count = u32_at(bytes, 32), table = 48, entry = 80;
    uint64_t first, next = length;
    memcpy(&first, bytes + table + k * entry + 72, sizeof first);
    if (k + 1 < count) {
        memcpy(&next, bytes + table + (k + 1) * entry + 72, sizeof next);
    }
    *size = (size_t)(next - first);
    return (size_t)first;
}

static void seal_map(unsigned char *bytes, size_t length) {
    put_u32(bytes, 24, crc32(bytes + CHECKED_FROM, length - CHECKED_FROM));
}

/* The map with changes: of every array as often, however large it is; now and then of the table of arrays. */
static unsigned char *changed_map(Input *input, int finite) {
    unsigned char *bytes = copy_of(whole_map, whole_length);
    const size_t count = u32_at(whole_map, 32);
    while (input->left > 0) {
        const unsigned which = take_byte(input) + 256 * take_byte(input);
        size_t size, place = array_place(whole_map, whole_length, which % count, &size);
        if (!finite && which >= 0xF000) {
            place = CHECKED_FROM;
            size = 16 + 80 * count;
        }
        if (size > 0) {
            change(bytes, place + size, place, input, finite);
        }
    }
    seal_map(bytes, whole_length);
    return bytes;
}

/* --- maps ------------------------------------------------------------------------------------------------------------ */

/* Suspects must be there exactly where some z is above the threshold, whatever the result of the screen in float. */
static void check_suspects(Estimator *e) {
    const MaskedMap *m = e->linear.prepared.masked;
    if (e->flight.present || !m->identified || !(e->output[CHI_SQUARE] < INFINITY)) {
        return;
    }
    ScaledStep *step = &e->linear.scaled.step;
    const double limits = e->inputs.value[e->map.n_gauges + ALARM_SCALE] * step->limit_ratio;
    const double threshold = m->outlier_threshold * sqrt(e->map.outlier_scale * limits);
    int above = 0;
    scaled_standardised_residuals(&e->linear.scaled, step->z);
    for (size_t k = 0; k < m->n_used; k++) {
        above |= fabs(step->z[m->used[k]]) > threshold;
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
        if (e->filter.present) { /* off, then on from the fifth step to the last but one */
            e->inputs.value[single_input(&e->inputs, TIME_CONSTANT_RUN)] = step < 4 || step == 9 ? 0.0 : 1.0;
        }
        for (size_t t = 0; e->thermal.present && t < e->thermal.map.n_sensors; t++) { /* others read in every third step */
            const int reads = (t + step / 3) % 3 != 0;
            const double reading = e->thermal.map.reference_temperature + 3.0 * (double)(t + step);
            e->inputs.value[e->inputs.first[TEMPERATURE_RUN] + t] = reads ? reading : NAN;
        }
        estimator_before_change(e);
        if (e->flight.present || e->filter.present) {
            estimator_step(e, 0.01 * step);
        }
        const int health = (int)estimator_outputs(e)[HEALTH_STATE];
        if (health < OK || health > OUTSIDE) {
            abort();
        }
        check_suspects(e);
        for (size_t i = 0; i < e->inputs.first[N_INPUT_RUNS]; i++) {
            e->direction[i] = 1.0;
        }
        estimator_derivative(e, e->direction, e->derivative, text);
    }
}

/* Whether a text is one line that ends within its room. */
static void check_text(const char *text, size_t room) {
    const char *end = memchr(text, 0, room);
    if (end == NULL || end == text || memchr(text, 10, (size_t)(end - text)) != NULL) {
        abort();
    }
}

static double *new_record(const StrainLoad *handle, int record) {
    double *values = calloc(sl_size(handle, record) + 1, sizeof *values);
    if (values == NULL) {
        abort();
    }
    return values;
}

static size_t least(size_t a, size_t b) {
    return a < b ? a : b;
}

/* Samples of any numbers, one by one and as a series. */
static void use_samples(StrainLoad *handle, Input *input) {
    enum { SAMPLES = 3 };
    const size_t n_in = sl_size(handle, SL_INPUTS), n_out = sl_size(handle, SL_OUTPUTS) + sl_size(handle, SL_FIT);
    const size_t rows = sl_size(handle, SL_ROWS);
    double *in = calloc(SAMPLES * n_in, sizeof *in), *out = calloc(SAMPLES * n_out, sizeof *out);
    double time[SAMPLES], start[4 * SAMPLES];
    unsigned char *valid = calloc(SAMPLES, rows);
    if (in == NULL || out == NULL || valid == NULL) {
        abort();
    }
    for (size_t k = 0; k < SAMPLES * n_in; k++) { /* plausible numbers, where the input has none */
        const double usual = k % n_in < rows ? 1e-5 * (double)(k % 7) : 5.0;
        in[k] = input->left > 0 && take_byte(input) % 4 == 0 ? take_number(input) : usual;
    }
    for (size_t k = 0; k < SAMPLES * rows; k++) {
        valid[k] = take_byte(input) != 255;
    }
    for (size_t k = 0; k < SAMPLES; k++) {
        time[k] = 0.01 * (double)k + (take_byte(input) > 250 ? take_number(input) : 0.0);
        for (size_t i = 0; i < 4; i++) {
            start[4 * k + i] = take_number(input);
        }
    }
    sl_series(handle, SL_TRACK, 1, SAMPLES, time, in, valid, NULL, out);
    sl_series(handle, SL_EACH, 1, SAMPLES, NULL, in, NULL, start, out);
    sl_restart(handle);
    for (size_t k = 0; k < SAMPLES; k++) {
        sl_step(handle, time[k], in + k * n_in, valid + k * rows, out);
    }
    free(in);
    free(out);
    free(valid);
}

/* Settings of any numbers; those that were accepted are read back. */
static void use_settings(StrainLoad *handle, Input *input) {
    char text[SL_TEXT_SIZE];
    const size_t n = sl_size(handle, SL_SETTINGS);
    for (unsigned k = take_byte(input) % 8; k > 0; k--) {
        const size_t place = n > 0 ? (take_byte(input) + 256 * take_byte(input)) % (n + 1) : 0;
        const double value = take_number(input);
        double again;
        if (!sl_set(handle, place, 1, &value, text)) {
            check_text(text, sizeof text);
        } else {
            sl_get(handle, place, 1, &again);
            if (memcmp(&again, &value, sizeof value) != 0) {
                abort();
            }
        }
    }
}

/* A changed state of samples, and of a tare: refused, or taken and used. */
static void use_states(StrainLoad *handle, Input *input, double *outcome) {
    char text[SL_TEXT_SIZE];
    const size_t size = sl_size(handle, SL_STATE), tare_size = sl_size(handle, SL_TARE_STATE);
    unsigned char *state = calloc(1, size + 1), *tare = calloc(1, tare_size + 1);
    if (state == NULL || tare == NULL) {
        abort();
    }
    sl_state(handle, state);
    sl_tare_state(handle, tare);
    if (!sl_restore(handle, state, text) || !sl_tare_restore(handle, tare, outcome, text)) {
        abort(); /* what the handle wrote itself */
    }
    for (unsigned k = take_byte(input) % 4; k > 0; k--) {
        change(state, size, 0, input, 0);
        change(tare, tare_size, 0, input, 0);
    }
    if (!sl_restore(handle, state, text)) {
        check_text(text, sizeof text);
    }
    if (!sl_tare_restore(handle, tare, outcome, text)) {
        check_text(text, sizeof text);
    }
    free(state);
    free(tare);
}

/* A window of readings around zeros, some of any numbers, at once and by steps. */
static void use_tare(StrainLoad *handle, Input *input) {
    enum { SAMPLES = 100 };
    double *limits = new_record(handle, SL_TARE_LIMITS), *outcome = new_record(handle, SL_TARE);
    if (sl_size(handle, SL_TARE) == 0) {
        sl_tare(handle, NULL, 0, NULL, NULL, outcome); /* nothing happens */
        free(limits);
        free(outcome);
        return;
    }
    const size_t n = (sl_size(handle, SL_TARE_LIMITS) - 3) / 2;
    double *strain = calloc(SAMPLES * n, sizeof *strain), pressure[SAMPLES];
    if (strain == NULL) {
        abort();
    }
    const size_t count = take_byte(input) % (SAMPLES + 1);
    limits[0] = limits[1] = limits[2] = 1e-3;
    for (size_t k = 0; k < SAMPLES * n; k++) {
        strain[k] = 1e-6 * (double)(k % n % 5) + 1e-9 * (double)(k * 7919 % 13);
    }
    for (size_t k = 0; k < SAMPLES; k++) {
        pressure[k] = 0.0;
    }
    for (unsigned k = take_byte(input) % 8; k > 0; k--) {
        strain[(take_byte(input) + 256 * take_byte(input)) % (SAMPLES * n)] = take_number(input);
        pressure[take_byte(input) % SAMPLES] = take_byte(input) % 4 ? 0.0 : take_number(input);
        limits[take_byte(input) % (3 + 2 * n)] = take_byte(input) % 4 ? 1e-3 : take_number(input);
    }
    sl_tare(handle, NULL, count, strain, pressure, outcome);
    sl_tare(handle, limits, count, strain, pressure, outcome);
    for (size_t k = 0; k <= SAMPLES; k++) {
        const size_t row = least(k, SAMPLES - 1);
        sl_tare_step(handle, k % 2 ? limits : NULL, k < count, strain + row * n, pressure[row], outcome);
        if (k == count / 2) {
            use_states(handle, input, outcome);
        }
    }
    if (outcome[4 * n + 3] != 0.0) { /* the zeros of a tare are settings that a handle accepts */
        char text[SL_TEXT_SIZE];
        sl_set(handle, 5, 2 * n + 1, outcome, text);
    }
    sl_tare_drop(handle, outcome);
    free(strain);
    free(limits);
    free(outcome);
}

/* Open bytes, which the call copies; use the handle. 1; 0, after a message, if they are refused. */
static int fuzz_handle(const unsigned char *bytes, size_t length, Input *input) {
    char text[SL_TEXT_SIZE] = "";
    StrainLoad *handle = sl_open(bytes, length, text);
    if (handle == NULL) {
        check_text(text, sizeof text);
        return 0;
    }
    SlField field;
    for (int record = 0; record < SL_ROWS; record++) {
        for (size_t k = 0; sl_field(handle, record, k, &field); k++) {
            if (memchr(field.name, 0, sizeof field.name) == NULL || field.first + field.count > sl_size(handle, record)) {
                abort();
            }
        }
    }
    use_settings(handle, input);
    use_samples(handle, input);
    use_tare(handle, input);
    use_samples(handle, input);
    sl_close(handle);
    return 1;
}

static void fuzz_map(Input *input, int choice) {
    char text[MODEL_TEXT_SIZE] = "";
    const size_t length = choice == 0 ? input->left : whole_length;
    unsigned char *bytes = choice == 0 ? copy_of(input->data, input->left) : changed_map(input, choice == 2);
    Input none = {bytes, 0};
    fuzz_handle(bytes, length, &none);
    Memory memory = {NULL, NULL, 0, 0};
    Estimator *e = estimator_create(&memory, bytes, length, text);
    if (e == NULL) {
        check_text(text, sizeof text);
    } else if (e->map.n_gauges <= MOST_GAUGES) {
        use(e);
    }
    memory_free(&memory);
    free(bytes);
}

/* --- states ----------------------------------------------------------------------------------------------------------- */

static void silent(const Instance *instance, int status, const char *category, const char *text) {
    (void)instance;
    (void)status;
    (void)category;
    if (strlen(text) > 4000) {
        abort();
    }
}

static Instance *new_instance(void) {
    char text[MODEL_TEXT_SIZE];
    Instance *instance = calloc(1, sizeof *instance);
    if (instance == NULL) {
        abort();
    }
    instance->model = model_create(copy_of(whole_map, whole_length), whole_length, text);
    if (instance->model == NULL) {
        abort();
    }
    instance->kind = CO_SIMULATION_2;
    instance->write = silent;
    instance_reset(instance);
    return instance;
}

/* A state of any bytes, or one of the map that is changed. */
static void fuzz_state(Input *input, int is_changed) {
    Instance *instance = new_instance();
    char text[MODEL_TEXT_SIZE];
    size_t size = is_changed ? state_size(instance) : input->left;
    unsigned char *bytes;
    void *state = NULL, *again = NULL;
    instance->model->mode = STEP;
    if (is_changed) {
        bytes = calloc(1, size);
        if (bytes == NULL || state_get(instance, "fuzz", &state) != STATUS_OK
            || state_serialize(instance, "fuzz", state, bytes, size) != STATUS_OK) {
            abort();
        }
        while (input->left > 0) {
            change(bytes, size, 24, input, 0);
        }
        put_u32(bytes, 12, crc32(bytes + 16, size - 16));
    } else {
        bytes = copy_of(input->data, size);
    }
    if (state_deserialize(instance, "fuzz", bytes, size, &state) == STATUS_OK) {
        if (state_set(instance, state) != STATUS_OK) {
            abort(); /* what was taken once must be taken again */
        }
        const Selection outputs = {NULL, 0, HEALTH_STATE};
        double value[HEALTH_STATE];
        if (!model_get(instance->model, REAL, &outputs, value, text)) {
            abort();
        }
        if (state_get(instance, "fuzz", &again) != STATUS_OK || state_serialize(instance, "fuzz", again, bytes, size) != STATUS_OK) {
            abort();
        }
        instance->model->mode = STEP;
        instance->model->time = 0.0;
        instance_step(instance, "step", 0.0, 0.01);
        if (!model_get(instance->model, REAL, &outputs, value, text)) {
            abort();
        }
    }
    state_free(instance, &state);
    state_free(instance, &again);
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
    const int choice = data[0] % N_CHOICES;
    Input input = {data + 1, size - 1};
    switch (choice) {
    case 0:                                          /* any bytes as a map */
    case 1:                                          /* changes of the map */
    case 2: fuzz_map(&input, choice); break;         /* changes that leave numbers finite */
    case 3:                                          /* any bytes as a state */
    case 4: fuzz_state(&input, choice == 4); break;  /* changes of a state */
    case 5: fuzz_handle(whole_map, whole_length, &input); break; /* settings, samples, states, tares */
    default: fuzz_location((const uint8_t *)data + 1, size - 1, choice - 6);
    }
    return 0;
}

static void read_map(const char *path) {
    static unsigned char bytes[1 << 24];
    FILE *file = path != NULL ? fopen(path, "rb") : NULL;
    if (file == NULL) {
        fprintf(stderr, "fuzz: no map\n");
        exit(1);
    }
    whole_length = fread(bytes, 1, sizeof bytes, file);
    whole_map = bytes;
    fclose(file);
}

#ifdef LIBFUZZER
int LLVMFuzzerInitialize(int *argc, char ***argv);

int LLVMFuzzerInitialize(int *argc, char ***argv) {
    (void)argc;
    (void)argv;
    read_map(getenv("FUZZ_MAP"));
    return 0;
}
#else
static void run_inputs(int count, char **paths) {
    for (int k = 0; k < count; k++) {
        FILE *file = fopen(paths[k], "rb");
        static uint8_t data[1 << 24];
        if (file == NULL) {
            exit(1);
        }
        const size_t size = fread(data, 1, sizeof data, file);
        uint8_t *exact = copy_of(data, size); /* so that reading behind it is found */
        LLVMFuzzerTestOneInput(exact, size);
        free(exact);
        fclose(file);
    }
    printf("%d inputs\n", count);
}

/* One to eight bits flipped; in a half of the copies all of them in one array, however small it is. */
static void run_flips(long count, uint64_t seed) {
    long opened = 0;
    for (long k = 0; k < count; k++) {
        unsigned char *bytes = copy_of(whole_map, whole_length);
        size_t place = CHECKED_FROM, size = whole_length - CHECKED_FROM;
        if (k % 2) {
            place = array_place(whole_map, whole_length, random_of(&seed) % u32_at(whole_map, 32), &size);
        }
        for (uint64_t flips = size > 0 ? 1 + random_of(&seed) % 8 : 0; flips > 0; flips--) {
            const uint64_t bit = random_of(&seed) % (8 * size);
            bytes[place + bit / 8] ^= (unsigned char)(1u << bit % 8);
        }
        seal_map(bytes, whole_length);
        Input none = {bytes, 0};
        opened += fuzz_handle(bytes, whole_length, &none);
        free(bytes);
    }
    printf("%ld flips, %ld opened\n", count, opened);
}

/* Whether the map opens; there is a message if not. */
static int opens(void) {
    char text[SL_TEXT_SIZE] = "";
    StrainLoad *handle = sl_open(whole_map, whole_length, text);
    const int opened = handle != NULL;
    if (!opened) {
        check_text(text, sizeof text);
    }
    sl_close(handle);
    return opened;
}

static void run_allocations(long count, uint64_t seed) {
    long single = 0, opened = 0;
    for (int done = 0; !done; single++) {
        allocation = 0;
        failing = single;
        done = opens();
    }
    failing = -1;
    for (long k = 0; k < count; k++) {
        failing_random = seed = seed * 2 + 1 + (uint64_t)k;
        opened += opens();
    }
    failing_random = 0;
    printf("%ld allocations, %ld times, %ld opened\n", single - 1, count, opened);
}

int main(int argc, char **argv) {
    if (argc < 3) {
        return 1;
    }
    read_map(argv[1]);
    const long count = argc > 3 ? strtol(argv[3], NULL, 10) : 0;
    const uint64_t seed = argc > 4 ? strtoull(argv[4], NULL, 10) : 1;
    if (strcmp(argv[2], "inputs") == 0) {
        run_inputs(argc - 3, argv + 3);
    } else if (strcmp(argv[2], "flips") == 0) {
        run_flips(count, seed);
    } else if (strcmp(argv[2], "allocations") == 0) {
        run_allocations(count, seed);
    } else {
        return 1;
    }
    return 0;
}
#endif
