/* Processor time of one step of an estimator FMU (FMI 2.0) in a C host, beside the bare product it stands for.

   step_cost LIBRARY GUID RESOURCES PRESSURE ZERO SENSORS REFERENCE FILTER REPEATS STRAIN...: prints nine times in
   seconds, of the bare 5 x n product, of a whole step at one dynamic pressure, of one at another dynamic pressure than
   the step before, of the same with the first gauge off, of the first two with zeros and temperatures, of the first in
   the state after initialization, which is restored before, of the first with the filter over time (nan without one),
   and of instantiation. A step is fmi2SetReal of the n strains (and of the dynamic pressure, and of other
   temperatures), fmi2DoStep, fmi2GetReal of five coefficients, fmi2GetInteger of the health state. Each time but the
   last is the median of REPEATS batches. Batches of all kinds take turns, so that their ratios do not depend on what
   else the machine does.

   PRESSURE is the nominal dynamic pressure [Pa]; ZERO the value reference of the first zero; SENSORS the number of
   temperature sensors, REFERENCE their temperature [K]; FILTER the value reference of the filter's time constant, 0 for
   none. STRAIN are n strains [m/m] that do not follow the dynamic pressure and n that do, at the nominal one. */

#define _POSIX_C_SOURCE 199309L
#include <dlfcn.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include "fmi2FunctionTypes.h"

/* Short batches, of which the median is one that no other program has slowed down. */
enum {
    CALLS = 1000, LEAST_CALLS = 4, FIRST_CALLS = 20, SETS = 64, N_OUTPUTS = 5, HEALTH_STATE = 20, FIRST_STRAIN = 27,
    MAX_SENSORS = 64, INSTANCES = 4, FIRST_WORD = 10
};

enum { NOMINAL, VARIED, FAULTY, WARM, WARM_VARIED, COLD, FILTERED, KINDS };

static const double BATCH = 2e-3;  /* [s] of a batch, if it is not shorter with CALLS */
static const double FAULT = 1e-3;  /* strain that the first gauge is off by [m/m] */
static const double ZERO = 1e-12;  /* value and deviation of each zero [m/m] */
static const double WARMER = 1e-3; /* by which temperatures change from step to step [K] */
static const double SIZE = 1e-3;   /* of a step [s] */
static const double CONSTANT = 10; /* time constant of the filter [s] */

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
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static int by_size(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static double median(double *values, size_t count)
{
    qsort(values, count, sizeof *values, by_size);
    return values[count / 2];
}

static double bare_product(size_t n, double *strain, size_t repeats)
{
    double *gain = calloc(N_OUTPUTS * n, sizeof *gain), *means = calloc(repeats, sizeof *means);
    volatile double out[N_OUTPUTS];
    for (size_t k = 0; k < N_OUTPUTS * n; k++) gain[k] = 1.0 / (double)(k + 1);
    for (size_t r = 0; r < repeats; r++) {
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
    const double found = median(means, repeats);
    free(means);
    free(gain);
    return found;
}

/* An FMU and the time it has come to [s]. */
typedef struct {
    fmi2Component fmu;
    double time;
} Instance;

typedef struct {
    fmi2SetRealTYPE *set_real;
    fmi2DoStepTYPE *do_step;
    fmi2GetRealTYPE *get_real;
    fmi2GetIntegerTYPE *get_integer;
    fmi2SetFMUstateTYPE *set_state;
    fmi2FMUstate initial; /* of the instance of COLD */
    size_t n, sensors;
    fmi2ValueReference *inputs, sensor[MAX_SENSORS];
    double *strain, *faulty, pressure[SETS], reference;
    int status;
} Bench;

/* Mean time of a step. */
static double batch(Bench *b, Instance *of, int kind, int calls)
{
    fmi2Component fmu = of->fmu;
    static const fmi2ValueReference OUTPUTS[] = {0, 1, 2, 3, 4}, STATE[] = {HEALTH_STATE};
    const fmi2ValueReference dynamic_pressure = (fmi2ValueReference)(FIRST_STRAIN + 2 * b->n);
    const int varied = kind == VARIED || kind == FAULTY || kind == WARM_VARIED, warm = kind == WARM || kind == WARM_VARIED;
    double *strains = kind == FAULTY ? b->faulty : b->strain, out[N_OUTPUTS], temperature[MAX_SENSORS];
    fmi2Integer health;
    if (!varied) { /* a set of the middle: the nominal dynamic pressure */
        b->status |= b->set_real(fmu, &dynamic_pressure, 1, b->pressure + SETS / 4);
    }
    double start = now();
    for (int c = 0; c < calls; c++) {
        const size_t set = varied ? (size_t)(c % SETS) : SETS / 4;
        double *strain = strains + set * b->n;
        strain[(size_t)c % b->n] += 1e-18;
        if (kind == COLD) {
            b->status |= b->set_state(fmu, b->initial);
            of->time = 0.0;
        }
        b->status |= b->set_real(fmu, b->inputs, b->n, strain);
        if (varied || kind == COLD) b->status |= b->set_real(fmu, &dynamic_pressure, 1, b->pressure + set);
        if (warm && b->sensors > 0) {
            for (size_t t = 0; t < b->sensors; t++) temperature[t] = b->reference + WARMER * (double)(c % SETS);
            b->status |= b->set_real(fmu, b->sensor, b->sensors, temperature);
        }
        b->status |= b->do_step(fmu, of->time, SIZE, 1);
        of->time += SIZE;
        b->status |= b->get_real(fmu, OUTPUTS, N_OUTPUTS, out);
        b->status |= b->get_integer(fmu, STATE, 1, &health);
    }
    return (now() - start) / calls;
}

static void draw_sets(Bench *b, double pressure, char **strains)
{
    b->inputs = calloc(b->n, sizeof *b->inputs);
    b->strain = calloc(2 * SETS * b->n, sizeof *b->strain);
    b->faulty = b->strain + SETS * b->n;
    for (size_t set = 0; set < SETS; set++) { /* from 0.7 to 1.3 of the nominal one, there and back */
        const double ratio = 0.7 + 1.2 / SETS * (double)(set < SETS / 2 ? set : SETS - set);
        b->pressure[set] = ratio * pressure;
        for (size_t k = 0; k < b->n; k++) {
            b->inputs[k] = (fmi2ValueReference)(FIRST_STRAIN + k);
            b->strain[set * b->n + k] = strtod(strains[k], NULL) + ratio * strtod(strains[b->n + k], NULL);
            b->faulty[set * b->n + k] = b->strain[set * b->n + k] + (k == 0 ? FAULT : 0.0);
        }
    }
}

int main(int count, char **words)
{
    if (count < FIRST_WORD + 2 || (count - FIRST_WORD) % 2) return 2;
    void *library = dlopen(words[1], RTLD_NOW);
    if (!library) {
        fprintf(stderr, "%s\n", dlerror());
        return 1;
    }
    Bench b = {.n = (size_t)(count - FIRST_WORD) / 2, .sensors = strtoul(words[6], NULL, 10)};
    b.reference = strtod(words[7], NULL);
    const unsigned long zero = strtoul(words[5], NULL, 10), filter = strtoul(words[8], NULL, 10);
    const size_t repeats = strtoul(words[9], NULL, 10);
    const int kinds = filter > 0 ? KINDS : FILTERED;
    if (b.sensors > MAX_SENSORS || repeats < 1) return 2;
#define LOAD(name) name##TYPE *name = (name##TYPE *)dlsym(library, #name)
    LOAD(fmi2Instantiate);
    LOAD(fmi2SetupExperiment);
    LOAD(fmi2EnterInitializationMode);
    LOAD(fmi2ExitInitializationMode);
    LOAD(fmi2Terminate);
    LOAD(fmi2FreeInstance);
    LOAD(fmi2GetFMUstate);
    LOAD(fmi2FreeFMUstate);
    b.set_real = (fmi2SetRealTYPE *)dlsym(library, "fmi2SetReal");
    b.do_step = (fmi2DoStepTYPE *)dlsym(library, "fmi2DoStep");
    b.get_real = (fmi2GetRealTYPE *)dlsym(library, "fmi2GetReal");
    b.get_integer = (fmi2GetIntegerTYPE *)dlsym(library, "fmi2GetInteger");
    b.set_state = (fmi2SetFMUstateTYPE *)dlsym(library, "fmi2SetFMUstate");
    fmi2CallbackFunctions callbacks = {logger, calloc, free, NULL, NULL};
    /* As it comes; with a fault, or cold; with zeros and temperatures; with the filter. A fault has an instance of its
       own: the nonlinear estimator would search for the flight state in the first step of the batch that comes next. */
    Instance instance[INSTANCES];
    Instance *of[KINDS] = {instance, instance, instance + 1, instance + 2, instance + 2, instance + 1, instance + 3};
    double instantiation = 0.0;
    for (int k = 0; k < INSTANCES; k++) {
        double start = now();
        fmi2Component fmu = fmi2Instantiate("bench", fmi2CoSimulation, words[2], words[3], &callbacks, 0, 0);
        instantiation = now() - start;
        if (!fmu) return 1;
        fmi2SetupExperiment(fmu, 0, 0.0, 0.0, 0, 0.0);
        fmi2EnterInitializationMode(fmu);
        fmi2ExitInitializationMode(fmu);
        instance[k] = (Instance){fmu, 0.0};
    }
    b.status |= fmi2GetFMUstate(instance[1].fmu, &b.initial);
    draw_sets(&b, strtod(words[4], NULL), words + FIRST_WORD);
    for (size_t k = 0; k < 2 * b.n; k++) {
        const fmi2ValueReference one = (fmi2ValueReference)(zero + k);
        b.status |= b.set_real(instance[2].fmu, &one, 1, &ZERO);
    }
    if (filter > 0) {
        const fmi2ValueReference one = (fmi2ValueReference)filter;
        b.status |= b.set_real(instance[3].fmu, &one, 1, &CONSTANT);
    }
    for (size_t t = 0; t < b.sensors; t++) b.sensor[t] = (fmi2ValueReference)(zero + 2 * b.n + 1 + t);
    double product = bare_product(b.n, b.strain, repeats);
    double *means = calloc(KINDS * repeats, sizeof *means); /* (KINDS, repeats) */
    int calls[KINDS];
    for (int kind = 0; kind < kinds; kind++) {
        batch(&b, of[kind], kind, FIRST_CALLS); /* what only the first steps need */
        const double mean = batch(&b, of[kind], kind, FIRST_CALLS), wanted = BATCH / mean;
        calls[kind] = wanted > CALLS ? CALLS : wanted < LEAST_CALLS ? LEAST_CALLS : (int)wanted;
    }
    for (size_t r = 0; r < repeats; r++) {
        for (int kind = 0; kind < kinds; kind++) {
            means[(size_t)kind * repeats + r] = batch(&b, of[kind], kind, calls[kind]);
        }
    }
    b.status |= fmi2FreeFMUstate(instance[1].fmu, &b.initial);
    for (int k = 0; k < INSTANCES; k++) {
        fmi2Terminate(instance[k].fmu);
        fmi2FreeInstance(instance[k].fmu);
    }
    if (b.status > fmi2Warning) return 1;
    printf("%.6e", product);
    for (int kind = 0; kind < KINDS; kind++) {
        printf(" %.6e", kind < kinds ? median(means + (size_t)kind * repeats, repeats) : NAN);
    }
    printf(" %.6e\n", instantiation);
    free(means);
    free(b.strain);
    free(b.inputs);
    return 0;
}
