/* An importer with a floating-point environment of its own: replays inputs and writes every output, as raw float64.

     traps LIBRARY GUID LOCATION MODE FILE

   MODE is "plain", the default environment; "traps", in which an invalid operation, a division by zero or an overflow
   ends the process; or "other", which rounds upwards and flushes subnormal numbers to zero.

   The file, all float64: numbers of real inputs and settings, of inputs with derivatives, of Boolean inputs, of real
   outputs, of whole outputs, of Boolean outputs, of steps; the value references of each; then for every step the real
   inputs and the Boolean inputs. */

#define _GNU_SOURCE

#include <fenv.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <xmmintrin.h>

#include "loaded_library.h"

#define TRAPPED (FE_INVALID | FE_DIVBYZERO | FE_OVERFLOW)
#define N_COEFFICIENTS 5 /* the first outputs, which have derivatives */
#define FLUSHED 0x8040 /* of MXCSR: results to zero, operands as zero */

enum { REALS, KNOWNS, FLAGS, OUTPUTS, WHOLE, OUTPUT_FLAGS, N_LISTS, STEPS = N_LISTS, N_SIZES };

static size_t size[N_SIZES];
static fmi2ValueReference *list[N_LISTS];

static void check(int right, const char *what) {
    if (!right) {
        fprintf(stderr, "traps: %s failed\n", what);
        exit(1);
    }
}

static void silent(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status, fmi2String category,
                   fmi2String message, ...) {
    (void)environment, (void)name, (void)status, (void)category, (void)message;
}

static double *read_file(const char *path) {
    FILE *file = fopen(path, "rb");
    check(file != NULL, "fopen");
    fseek(file, 0, SEEK_END);
    const size_t length = (size_t)ftell(file);
    double *content = malloc(length);
    rewind(file);
    check(content != NULL && fread(content, 1, length, file) == length, "fread");
    fclose(file);
    for (int k = 0; k < N_SIZES; k++) {
        size[k] = (size_t)content[k];
    }
    double *next = content + N_SIZES;
    for (int k = 0; k < N_LISTS; k++) {
        list[k] = calloc(size[k] + 1, sizeof *list[k]);
        for (size_t i = 0; i < size[k]; i++) {
            list[k][i] = (fmi2ValueReference)*next++;
        }
    }
    return next;
}

static void take_environment(const char *mode) {
    if (strcmp(mode, "traps") == 0) {
        feenableexcept(TRAPPED);
    } else if (strcmp(mode, "other") == 0) {
        fesetround(FE_UPWARD);
        _mm_setcsr(_mm_getcsr() | FLUSHED);
    }
}

static void start(fmi2Component c) {
    check(fmi2SetupExperiment(c, 0, 0.0, 0.0, 0, 0.0) == fmi2OK, "fmi2SetupExperiment");
    check(fmi2EnterInitializationMode(c) == fmi2OK, "fmi2EnterInitializationMode");
    check(fmi2ExitInitializationMode(c) == fmi2OK, "fmi2ExitInitializationMode");
}

/* The state goes through its bytes, and back. */
static void exchange_state(fmi2Component c) {
    fmi2FMUstate state = NULL, copy = NULL;
    size_t length;
    check(fmi2GetFMUstate(c, &state) == fmi2OK, "fmi2GetFMUstate");
    check(fmi2SerializedFMUstateSize(c, state, &length) == fmi2OK, "fmi2SerializedFMUstateSize");
    char *bytes = malloc(length);
    check(bytes != NULL && fmi2SerializeFMUstate(c, state, bytes, length) == fmi2OK, "fmi2SerializeFMUstate");
    check(fmi2DeSerializeFMUstate(c, bytes, length, &copy) == fmi2OK, "fmi2DeSerializeFMUstate");
    check(fmi2SetFMUstate(c, copy) == fmi2OK, "fmi2SetFMUstate");
    fmi2FreeFMUstate(c, &state);
    fmi2FreeFMUstate(c, &copy);
    free(bytes);
}

static void step(fmi2Component c, size_t k, const double *row, double *out, fmi2Integer *whole) {
    static const double NO_STEPS[][2] = {{0.0, 0.0 / 0.0}, {1e308, 1e308}, {0.0, -1.0}, {0.0 / 0.0, 1.0}};
    for (size_t i = 0; i < size[REALS]; i++) { /* settings refuse what they cannot be */
        fmi2SetReal(c, list[REALS] + i, 1, row + i);
    }
    for (size_t i = 0; i < size[FLAGS]; i++) {
        whole[i] = row[size[REALS] + i] > 0.0;
    }
    check(fmi2SetBoolean(c, list[FLAGS], size[FLAGS], whole) == fmi2OK, "fmi2SetBoolean");
    check(fmi2DoStep(c, NO_STEPS[k % 4][0], NO_STEPS[k % 4][1], 1) == fmi2Error, "refusing a step");
    check(fmi2DoStep(c, 0.0078125 * (double)k, 0.0078125, 1) == fmi2OK, "fmi2DoStep");
    check(fmi2GetReal(c, list[OUTPUTS], size[OUTPUTS], out) == fmi2OK, "fmi2GetReal");
    fwrite(out, sizeof *out, size[OUTPUTS], stdout);
    check(fmi2GetInteger(c, list[WHOLE], size[WHOLE], whole) == fmi2OK, "fmi2GetInteger");
    for (size_t i = 0; i < size[WHOLE]; i++) {
        out[i] = whole[i];
    }
    fwrite(out, sizeof *out, size[WHOLE], stdout);
    check(fmi2GetBoolean(c, list[OUTPUT_FLAGS], size[OUTPUT_FLAGS], whole) == fmi2OK, "fmi2GetBoolean");
    memset(out, 0, size[OUTPUTS] * sizeof *out); /* of the derivatives, where they are refused */
    if (k % 5 == 0) {
        fmi2GetDirectionalDerivative(c, list[OUTPUTS], N_COEFFICIENTS, list[KNOWNS], size[KNOWNS], row, out);
    }
    fwrite(out, sizeof *out, size[OUTPUTS], stdout);
}

int main(int argc, char **argv) {
    check(argc == 6, "arguments");
    load_library(argv[1]);
    const double *row = read_file(argv[5]);
    double *out = calloc(size[OUTPUTS] + size[WHOLE], sizeof *out);
    fmi2Integer *whole = calloc(size[WHOLE] + size[FLAGS] + size[OUTPUT_FLAGS], sizeof *whole);
    const fmi2CallbackFunctions callbacks = {silent, NULL, NULL, NULL, NULL};
    take_environment(argv[4]);
    const int rounding = fegetround();
    fmi2Component c = fmi2Instantiate("traps", fmi2CoSimulation, argv[2], argv[3], &callbacks, 0, 1);
    check(c != NULL, "fmi2Instantiate");
    start(c);
    for (size_t k = 0; k < size[STEPS]; k++, row += size[REALS] + size[FLAGS]) {
        if (k == size[STEPS] / 2) {
            check(fmi2Reset(c) == fmi2OK, "fmi2Reset");
            start(c);
        }
        step(c, k, row, out, whole);
        if (k % 11 == 0) {
            exchange_state(c);
        }
        check(fegetround() == rounding, "keeping the host's rounding");
        check(fetestexcept(TRAPPED) == 0, "keeping exceptions from the host");
    }
    fmi2FreeInstance(c);
    return 0;
}
