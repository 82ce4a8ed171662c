/* Time of one step of an estimator FMU (FMI 2.0) in a C host, beside the bare product it stands for.

   step_cost LIBRARY GUID RESOURCES PRESSURE STRAIN...: prints five times in seconds, of the bare 5 x n product, of a
   whole step at one dynamic pressure, of one at another dynamic pressure than the step before, of the same with the
   first gauge off, and of instantiation. A step is fmi2SetReal of the n strains (and of the dynamic pressure),
   fmi2DoStep, fmi2GetReal of five coefficients, fmi2GetInteger of the health state.

   PRESSURE is the nominal dynamic pressure [Pa]. STRAIN are n strains [m/m] that do not follow it and n that do, at
   the nominal one. */

#define _POSIX_C_SOURCE 199309L
#include <dlfcn.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include "fmi2FunctionTypes.h"

/* Batches shorter than a time slice: the median is then one that no other program has cut in two. */
enum { REPEATS = 501, CALLS = 1000, SETS = 64, N_OUTPUTS = 5, HEALTH_STATE = 20, FIRST_STRAIN = 27 };

static const double FAULT = 1e-3; /* strain that the first gauge is off by [m/m] */

static void logger(fmi2ComponentEnvironment e, fmi2String n, fmi2Status s, fmi2String c, fmi2String message, ...)
{
    va_list arguments;
    (void)e, (void)n, (void)s, (void)c;
    va_start(arguments, message);
    vfprintf(stderr, message, arguments);
    va_end(arguments);
    fputc('\n', stderr);
}

static double now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static int by_size(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static double median(double *values)
{
    qsort(values, REPEATS, sizeof *values, by_size);
    return values[REPEATS / 2];
}

static double bare_product(size_t n, double *strain)
{
    double *gain = calloc(N_OUTPUTS * n, sizeof *gain), means[REPEATS];
    volatile double out[N_OUTPUTS];
    for (size_t k = 0; k < N_OUTPUTS * n; k++) gain[k] = 1.0 / (double)(k + 1);
    for (int r = 0; r < REPEATS; r++) {
        double start = now();
        for (int c = 0; c < CALLS; c++) {
            strain[c % n] += 1e-18;
            for (int i = 0; i < N_OUTPUTS; i++) {
                double sum = 0.0;
                for (size_t j = 0; j < n; j++) sum += gain[i * n + j] * strain[j];
                out[i] = sum;
            }
        }
        means[r] = (now() - start) / CALLS;
    }
    (void)out;
    free(gain);
    return median(means);
}

int main(int count, char **words)
{
    if (count < 7 || count % 2 == 0) return 2;
    void *library = dlopen(words[1], RTLD_NOW);
    if (!library) {
        fprintf(stderr, "%s\n", dlerror());
        return 1;
    }
    size_t n = ((size_t)count - 5) / 2;
#define LOAD(name) name##TYPE *name = (name##TYPE *)dlsym(library, #name)
    LOAD(fmi2Instantiate);
    LOAD(fmi2SetupExperiment);
    LOAD(fmi2EnterInitializationMode);
    LOAD(fmi2ExitInitializationMode);
    LOAD(fmi2SetReal);
    LOAD(fmi2DoStep);
    LOAD(fmi2GetReal);
    LOAD(fmi2GetInteger);
    LOAD(fmi2Terminate);
    LOAD(fmi2FreeInstance);
    fmi2CallbackFunctions callbacks = {logger, calloc, free, NULL, NULL};
    double start = now();
    fmi2Component fmu = fmi2Instantiate("bench", fmi2CoSimulation, words[2], words[3], &callbacks, 0, 0);
    double instantiation = now() - start;
    if (!fmu) return 1;
    fmi2SetupExperiment(fmu, 0, 0.0, 0.0, 0, 0.0);
    fmi2EnterInitializationMode(fmu);
    fmi2ExitInitializationMode(fmu);
    double *strain = calloc(SETS * n, sizeof *strain), pressure[SETS];
    double means[REPEATS], steps[3], out[N_OUTPUTS];
    fmi2ValueReference *inputs = calloc(n, sizeof *inputs), outputs[] = {0, 1, 2, 3, 4}, state[] = {HEALTH_STATE};
    const fmi2ValueReference dynamic_pressure = (fmi2ValueReference)(FIRST_STRAIN + 2 * n);
    fmi2Integer health;
    for (size_t set = 0; set < SETS; set++) { /* from 0.7 to 1.3 of the nominal one, there and back */
        const double ratio = 0.7 + 1.2 / SETS * (double)(set < SETS / 2 ? set : SETS - set);
        pressure[set] = ratio * strtod(words[4], NULL);
        for (size_t k = 0; k < n; k++) {
            inputs[k] = (fmi2ValueReference)(FIRST_STRAIN + k);
            strain[set * n + k] = strtod(words[5 + k], NULL) + ratio * strtod(words[5 + n + k], NULL);
        }
    }
    double product = bare_product(n, strain);
    int status = 0;
    for (int kind = 0; kind < 3; kind++) {
        const int varied = kind > 0;
        if (!varied) { /* a set of the middle: the nominal dynamic pressure */
            status |= fmi2SetReal(fmu, &dynamic_pressure, 1, pressure + SETS / 4);
        }
        for (size_t set = 0; kind == 2 && set < SETS; set++) strain[set * n] += FAULT;
        for (int r = 0; r < REPEATS; r++) {
            start = now();
            for (int c = 0; c < CALLS; c++) {
                const size_t set = varied ? (size_t)(c % SETS) : SETS / 4;
                strain[set * n + (size_t)c % n] += 1e-18;
                status |= fmi2SetReal(fmu, inputs, n, strain + set * n);
                if (varied) status |= fmi2SetReal(fmu, &dynamic_pressure, 1, pressure + set);
                status |= fmi2DoStep(fmu, c * 1e-3, 1e-3, 1);
                status |= fmi2GetReal(fmu, outputs, N_OUTPUTS, out);
                status |= fmi2GetInteger(fmu, state, 1, &health);
            }
            means[r] = (now() - start) / CALLS;
        }
        steps[kind] = median(means);
    }
    fmi2Terminate(fmu);
    fmi2FreeInstance(fmu);
    if (status > fmi2Warning) return 1;
    printf("%.6e %.6e %.6e %.6e %.6e\n", product, steps[0], steps[1], steps[2], instantiation);
    free(strain);
    free(inputs);
    return 0;
}
