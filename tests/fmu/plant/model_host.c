/* Runs a model.bin. `model_host run FOLDER GUID STEPS`: every output after every step, as hexadecimal float64, with
   inputs and parameters drawn again. `model_host damage FILE TRIALS`: loads and steps models whose bytes were altered
   with a right checksum, so that every check behind it is reached. */

#include "fmi2Functions.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/instance.h"
#include "core/resource.h"
#include "system/system_model.h"

static uint64_t seed = 1;

static uint32_t draw(void) {
    seed = seed * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
    return (uint32_t)(seed >> 33);
}

/* From low to high; the same on every platform. */
static double uniform(double low, double high) {
    return low + (high - low) * (double)draw() * (1.0 / 2147483648.0);
}

static void report(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status, fmi2String category,
                 fmi2String format, ...) {
    va_list arguments;
    (void)environment;
    fprintf(stderr, "%s %d %s: ", name, (int)status, category);
    va_start(arguments, format);
    vfprintf(stderr, format, arguments);
    va_end(arguments);
    fprintf(stderr, "\n");
}

static void print(double value) {
    uint64_t bits;
    memcpy(&bits, &value, sizeof bits);
    printf("%08lx%08lx\n", (unsigned long)(bits >> 32), (unsigned long)(bits & 0xFFFFFFFFu));
}

/* Set an input near its start value, so that flights stay inside their envelope, and now and then a fault. */
static void disturb(SystemModel *model) {
    char text[MODEL_TEXT_SIZE];
    for (size_t i = 0; i < model->n_variables; i++) {
        if (model->causality[i] != INPUT) {
            continue;
        }
        const int real = model->type[i] == REAL;
        const double start = model->start[i];
        const double size = start < 0.0 ? -start : start, spread = size > 0.0 ? 0.05 * size : 1e-6;
        double value = real ? start + uniform(-spread, spread) : model->minimum[i];
        if (!real && draw() % 50 == 0 && model->maximum[i] < 100.0) {
            value = model->minimum[i] + (double)(draw() % (uint32_t)(model->maximum[i] - model->minimum[i] + 1.0));
        }
        const Selection one = {NULL, i, 1};
        const int whole = real ? 0 : (int)value;
        model_set(&model->base, (Type)model->type[i], &one, real ? (const void *)&value : (const void *)&whole, text);
    }
}

static int run(const char *folder, const char *guid, int steps) {
    const fmi2CallbackFunctions functions = {report, calloc, free, NULL, NULL};
    Instance *instance = fmi2Instantiate("host", fmi2CoSimulation, guid, folder, &functions, fmi2False, fmi2False);
    if (instance == NULL) {
        return 1;
    }
    fmi2SetupExperiment(instance, fmi2False, 0.0, 0.0, fmi2False, 0.0);
    fmi2EnterInitializationMode(instance);
    fmi2ExitInitializationMode(instance);
    SystemModel *model = (SystemModel *)instance->model;
    fmi2FMUstate state = NULL;
    for (int k = 0; k < steps; k++) {
        disturb(model);
        fmi2DoStep(instance, 0.01 * k, 0.01, fmi2True);
        system_update(model);
        for (size_t i = 0; i < model->n_variables; i++) {
            if (model->causality[i] == OUTPUT) {
                print(model->value[i]);
            }
        }
        if (k % 10 == 0) { /* there and back again */
            fmi2GetFMUstate(instance, &state);
            fmi2DoStep(instance, 0.01 * (k + 1), 0.5, fmi2True);
            fmi2SetFMUstate(instance, state);
        }
    }
    fmi2FreeFMUstate(instance, &state);
    fmi2Terminate(instance);
    fmi2FreeInstance(instance);
    return 0;
}

static void try_model(unsigned char *bytes, size_t length, int *loaded) {
    char text[MODEL_TEXT_SIZE];
    SystemModel *model = (SystemModel *)model_create(bytes, length, text);
    if (model == NULL) {
        return;
    }
    ++*loaded;
    system_update(model);
    model->base.mode = STEP;
    for (int k = 0; k < 3; k++) {
        disturb(model);
        system_update(model);
        model->behaviour->step(model, 0.002 * (k + 1), text);
        model->outdated = 1;
    }
    system_update(model);
    model_destroy(&model->base);
}

static int damage(const char *file, int trials) {
    char text[MODEL_TEXT_SIZE];
    size_t length;
    int loaded = 0;
    unsigned char *whole = resource_read(file, &length, text);
    if (whole == NULL) {
        return 1;
    }
    for (int k = 0; k < trials; k++) {
        unsigned char *bytes = malloc(length);
        memcpy(bytes, whole, length);
        for (uint32_t n = 1 + draw() % 4; n > 0; n--) {
            /* Mostly the header and the sizes of the data, where it matters. */
            const size_t position = draw() % (draw() % 2 ? length : (length < 8000 ? length : 8000));
            bytes[position] = (unsigned char)(draw() % 3 ? draw() : bytes[position] ^ (1u << draw() % 8));
        }
        if (draw() % 2) {
            const double values[] = {0.0, 1.0, 2.0, 3.0, -1.0, 65536.0, 1e9, 1e300, -1e300, 0.5};
            memcpy(bytes + 128 + 8 * (draw() % ((length - 128) / 8)), values + draw() % 10, 8);
        }
        const uint32_t checksum = crc32(bytes + 32, length - 32), zero = 0;
        const uint64_t stated = length;
        memcpy(bytes, whole, 16);
        memcpy(bytes + 16, &stated, 8);
        memcpy(bytes + 24, &checksum, 4);
        memcpy(bytes + 28, &zero, 4);
        try_model(bytes, length, &loaded);
    }
    free(whole);
    printf("%d of %d loaded\n", loaded, trials);
    return 0;
}

int main(int count, char **arguments) {
    if (count == 5 && strcmp(arguments[1], "run") == 0) {
        return run(arguments[2], arguments[3], atoi(arguments[4]));
    }
    return count == 4 && strcmp(arguments[1], "damage") == 0 ? damage(arguments[2], atoi(arguments[3])) : 2;
}
