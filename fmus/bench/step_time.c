/* Processor time of steps of an estimator FMU (FMI 2.0) in a C host.

       step_time usual LIBRARY GUID RESOURCES PRESSURE FILTER REPEATS ZERO SENSORS REFERENCE STRAIN...
       step_time worst LIBRARY GUID RESOURCES PRESSURE FILTER REPEATS ZERO MACH TARE STEPS STRAIN...

   usual prints nine times in seconds: of the bare 5 x n product, of a whole step at one dynamic pressure, of one at another
   dynamic pressure than the step before, of the same with the first gauge off, of the first two with zeros and temperatures,
   of the first in the state after initialization, which is restored before, of the first with the filter over time (nan
   without one), and of instantiation. Each time but the last is the median of REPEATS batches. Batches of all kinds take
   turns, so that their ratios do not depend on what else the machine does. SENSORS is the number of temperature sensors,
   REFERENCE their temperature [K]; ZERO the value reference of the first zero.

   worst prints a line for each event that the FMU can have, each alone, and all in one step: its number, then median and
   largest of REPEATS steps; of the deviation of a zero, which is followed over several steps, the largest of these. The last
   line is of STEPS steps with events at random: the number behind the last event, median, 99.99 % and largest. Ordinary steps
   lie between those that are timed. ZERO is the value reference of the first deviation of a zero, TARE that of the input of
   the tare; MACH a Mach number of the map's tables, 0 without tables.

   A step is fmi2SetReal of the n strains and of the flow, of what the event changes, fmi2DoStep, fmi2GetReal of outputs,
   fmi2GetInteger of the health state. PRESSURE is the nominal dynamic pressure [Pa]; FILTER the value reference of the
   filter's time constant, 0 for none. STRAIN are n strains [m/m] that do not follow the dynamic pressure and n that do, at
   the nominal one. */

#define _POSIX_C_SOURCE 199309L
#include <dlfcn.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "fmi2FunctionTypes.h"

enum { N_COEFFICIENTS = 5, N_READ = 20, HEALTH_STATE = 20, FIRST_STRAIN = 27, MOST_GAUGES = 4096 };

static const double SIZE = 1e-3;     /* of a step [s] */
static const double CONSTANT = 10.0; /* time constant of the filter [s] */

#define FUNCTIONS(DO)               \
    DO(fmi2Instantiate)             \
    DO(fmi2SetupExperiment)         \
    DO(fmi2EnterInitializationMode) \
    DO(fmi2ExitInitializationMode)  \
    DO(fmi2FreeInstance)            \
    DO(fmi2SetReal)                 \
    DO(fmi2SetBoolean)              \
    DO(fmi2DoStep)                  \
    DO(fmi2GetReal)                 \
    DO(fmi2GetInteger)              \
    DO(fmi2GetFMUstate)             \
    DO(fmi2SetFMUstate)             \
    DO(fmi2FreeFMUstate)
#define DECLARE(name) static name##TYPE *name;
FUNCTIONS(DECLARE)

/* An FMU and the time it has come to [s]. */
typedef struct {
    fmi2Component fmu;
    double time;
} Instance;

static const char *guid, *resources;
static size_t n, repeats;
static double pressure, fixed_part[MOST_GAUGES], scaled_part[MOST_GAUGES];
static fmi2ValueReference inputs[MOST_GAUGES], flags[MOST_GAUGES], read[N_READ], zero, filter;

static void logger(fmi2ComponentEnvironment e, fmi2String name, fmi2Status s, fmi2String c, fmi2String message, ...)
{
    va_list arguments;
    (void)e, (void)name, (void)s, (void)c;
    va_start(arguments, message);
    vfprintf(stderr, message, arguments);
    va_end(arguments);
    fputc('\n', stderr);
}

static void check(int good, const char *what)
{
    if (!good) {
        fprintf(stderr, "step_time: %s failed\n", what);
        exit(1);
    }
}

static double seconds(void)
{
    struct timespec t;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static int by_size(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* Sort them, and return the one in the middle. */
static double median(double *times, size_t count)
{
    qsort(times, count, sizeof *times, by_size);
    return times[count / 2];
}

/* A new instance in place of the last one, if any: it keeps nothing for a set of gauges or a dynamic pressure. The time that it
   takes. */
static double begin(Instance *instance, int filtered)
{
    static const fmi2CallbackFunctions callbacks = {logger, calloc, free, NULL, NULL};
    if (instance->fmu != NULL) {
        fmi2FreeInstance(instance->fmu);
    }
    const double start = seconds();
    fmi2Component fmu = fmi2Instantiate("bench", fmi2CoSimulation, guid, resources, &callbacks, 0, 0);
    const double taken = seconds() - start;
    check(fmu != NULL && fmi2SetupExperiment(fmu, 0, 0.0, 0.0, 0, 0.0) == fmi2OK
              && fmi2EnterInitializationMode(fmu) == fmi2OK && fmi2ExitInitializationMode(fmu) == fmi2OK
              && (!filtered || fmi2SetReal(fmu, &filter, 1, &CONSTANT) == fmi2OK),
          "beginning");
    *instance = (Instance){fmu, 0.0};
    return taken;
}

/* Take the step and read so many outputs and the health state; whether that is done. */
static int step_and_read(Instance *instance, size_t n_read)
{
    static const fmi2ValueReference HEALTH = HEALTH_STATE;
    double values[N_READ];
    fmi2Integer state;
    const double start = instance->time;
    instance->time += SIZE;
    return fmi2DoStep(instance->fmu, start, SIZE, 1) == fmi2OK && fmi2GetReal(instance->fmu, read, n_read, values) == fmi2OK
        && fmi2GetInteger(instance->fmu, &HEALTH, 1, &state) == fmi2OK;
}

/* --- usual steps ------------------------------------------------------------------------------------------------------ */

/* Short batches, of which the median is one that no other program has slowed down. */
enum { CALLS = 1000, LEAST_CALLS = 4, FIRST_CALLS = 20, SETS = 64, MAX_SENSORS = 64, INSTANCES = 4 };

enum { NOMINAL, VARIED, FAULTY, WARM, WARM_VARIED, AGAIN, FILTERED, KINDS };

static const double BATCH = 2e-3;  /* [s] of a batch, if it is not shorter with CALLS */
static const double FAULT = 1e-3;  /* strain that the first gauge is off by [m/m] */
static const double ZERO = 1e-12;  /* value and deviation of each zero [m/m] */
static const double WARMER = 1e-3; /* by which temperatures change from step to step [K] */

static fmi2FMUstate initial; /* of the instance of AGAIN */
static size_t n_sensors;
static fmi2ValueReference sensor[MAX_SENSORS];
static double *sets[2], pressures[SETS], reference; /* strains, and with a gauge that is off */

static double bare_product(void)
{
    double *gain = calloc(N_COEFFICIENTS * n, sizeof *gain), *means = calloc(repeats, sizeof *means), *strain = sets[0];
    volatile double out[N_COEFFICIENTS];
    for (size_t k = 0; k < N_COEFFICIENTS * n; k++) gain[k] = 1.0 / (double)(k + 1);
    for (size_t r = 0; r < repeats; r++) {
        const double start = seconds();
        for (int c = 0; c < CALLS; c++) {
            strain[(size_t)c % n] += 1e-18;
            for (size_t i = 0; i < N_COEFFICIENTS; i++) {
                double sum = 0.0;
                for (size_t j = 0; j < n; j++) sum += gain[i * n + j] * strain[j];
                out[i] = sum;
            }
        }
        means[r] = (seconds() - start) / CALLS;
    }
    (void)out;
    const double found = median(means, repeats);
    free(means);
    free(gain);
    return found;
}

/* Mean time of a step. */
static double batch(Instance *of, int kind, int calls)
{
    const fmi2ValueReference dynamic_pressure = (fmi2ValueReference)(FIRST_STRAIN + 2 * n);
    const int varied = kind == VARIED || kind == FAULTY || kind == WARM_VARIED, warm = kind == WARM || kind == WARM_VARIED;
    double temperature[MAX_SENSORS];
    int good = varied /* else a set of the middle: the nominal dynamic pressure */
            || fmi2SetReal(of->fmu, &dynamic_pressure, 1, pressures + SETS / 4) == fmi2OK;
    const double start = seconds();
    for (int c = 0; c < calls; c++) {
        const size_t set = varied ? (size_t)(c % SETS) : SETS / 4;
        double *strain = sets[kind == FAULTY] + set * n;
        strain[(size_t)c % n] += 1e-18;
        if (kind == AGAIN) {
            good &= fmi2SetFMUstate(of->fmu, initial) == fmi2OK;
            of->time = 0.0;
        }
        good &= fmi2SetReal(of->fmu, inputs, n, strain) == fmi2OK;
        if (varied || kind == AGAIN) good &= fmi2SetReal(of->fmu, &dynamic_pressure, 1, pressures + set) == fmi2OK;
        if (warm && n_sensors > 0) {
            for (size_t t = 0; t < n_sensors; t++) temperature[t] = reference + WARMER * (double)(c % SETS);
            good &= fmi2SetReal(of->fmu, sensor, n_sensors, temperature) == fmi2OK;
        }
        good &= step_and_read(of, N_COEFFICIENTS);
    }
    check(good, "a step");
    return (seconds() - start) / calls;
}

static void draw_sets(void)
{
    for (size_t k = 0; k < 2; k++) sets[k] = calloc(SETS * n, sizeof **sets);
    for (size_t set = 0; set < SETS; set++) { /* from 0.7 to 1.3 of the nominal one, there and back */
        const double ratio = 0.7 + 1.2 / SETS * (double)(set < SETS / 2 ? set : SETS - set);
        pressures[set] = ratio * pressure;
        for (size_t k = 0; k < n; k++) {
            sets[0][set * n + k] = fixed_part[k] + ratio * scaled_part[k];
            sets[1][set * n + k] = sets[0][set * n + k] + (k == 0 ? FAULT : 0.0);
        }
    }
}

static void usual(char **words)
{
    /* As it comes; with a fault, or again from the start; with zeros and temperatures; with the filter. A fault has an instance of
       its own: the nonlinear estimator would search for the flight state in the first step of the batch that comes next. */
    Instance instance[INSTANCES] = {{NULL, 0.0}};
    Instance *of[KINDS] = {instance, instance, instance + 1, instance + 2, instance + 2, instance + 1, instance + 3};
    const int kinds = filter > 0 ? KINDS : FILTERED;
    double instantiation = 0.0, *means = calloc(KINDS * repeats, sizeof *means); /* (KINDS, repeats) */
    int calls[KINDS];
    n_sensors = strtoul(words[0], NULL, 10);
    reference = strtod(words[1], NULL);
    check(n_sensors <= MAX_SENSORS, "arguments");
    for (int k = 0; k < INSTANCES; k++) instantiation = begin(&instance[k], k == INSTANCES - 1 && filter > 0);
    check(fmi2GetFMUstate(instance[1].fmu, &initial) == fmi2OK, "fmi2GetFMUstate");
    draw_sets();
    for (size_t k = 0; k < 2 * n; k++) {
        const fmi2ValueReference one = zero + (fmi2ValueReference)k;
        check(fmi2SetReal(instance[2].fmu, &one, 1, &ZERO) == fmi2OK, "fmi2SetReal");
    }
    for (size_t t = 0; t < n_sensors; t++) sensor[t] = zero + (fmi2ValueReference)(2 * n + 1 + t);
    printf("%.6e", bare_product());
    for (int kind = 0; kind < kinds; kind++) {
        batch(of[kind], kind, FIRST_CALLS); /* what only the first steps need */
        const double wanted = BATCH / batch(of[kind], kind, FIRST_CALLS);
        calls[kind] = wanted > CALLS ? CALLS : wanted < LEAST_CALLS ? LEAST_CALLS : (int)wanted;
    }
    for (size_t r = 0; r < repeats; r++) {
        for (int kind = 0; kind < kinds; kind++) {
            means[(size_t)kind * repeats + r] = batch(of[kind], kind, calls[kind]);
        }
    }
    for (int kind = 0; kind < KINDS; kind++) {
        printf(" %.6e", kind < kinds ? median(means + (size_t)kind * repeats, repeats) : NAN);
    }
    printf(" %.6e\n", instantiation);
    fmi2FreeFMUstate(instance[1].fmu, &initial);
    for (int k = 0; k < INSTANCES; k++) fmi2FreeInstance(instance[k].fmu);
    for (size_t k = 0; k < 2; k++) free(sets[k]);
    free(means);
}

/* --- the dearest steps ------------------------------------------------------------------------------------------------- */

enum { BETWEEN = 16, WINDOW = 80 };

/* Events of a step. */
enum { ORDINARY, ONE_LOST, THIRD_LOST, DEVIATION, COLD, NO_FIT, WITHOUT_PRESSURE, ALL_AT_ONCE, EVENTS };

static const double OFF = 1e-4;        /* strain by which gauges are off, up and down [m/m] */
static const double DEVIATIONS = 1e-9; /* of a zero; each change by as much [m/m] */

static Instance track;
static double strain[MOST_GAUGES], mach, deviation;
static fmi2ValueReference tare;
static fmi2Boolean valid[MOST_GAUGES];
static unsigned random_state = 1;

/* From 0 up to, not including, `below`. */
static unsigned drawn(unsigned below)
{
    random_state = random_state * 1103515245u + 12345u;
    return (random_state >> 16) % below;
}

static int is(int event, int asked)
{
    return asked == event || (asked == ALL_AT_ONCE && event != ORDINARY && event != ONE_LOST && event != WITHOUT_PRESSURE);
}

/* What a step changes besides the strains. */
typedef struct {
    double of_flow[2]; /* dynamic pressure [Pa], Mach number */
    int masks, deviates, tares;
    fmi2Boolean asks; /* for a tare, where it tares */
} Changes;

/* Inputs of a step with an event: a slow motion, of which the strains follow the dynamic pressure. */
static Changes draw(int event)
{
    const double ratio = 0.9 + 0.2 * drawn(1000) / 1000.0;
    for (size_t k = 0; k < n; k++) {
        strain[k] = fixed_part[k] + ratio * scaled_part[k] + (is(NO_FIT, event) ? (k % 2 ? OFF : -OFF) : 0.0);
        valid[k] = !is(THIRD_LOST, event);
    }
    if (is(THIRD_LOST, event)) { /* two thirds stay, at random */
        for (size_t left = n - n / 3; left > 0;) {
            const unsigned k = drawn((unsigned)n);
            left -= !valid[k];
            valid[k] = 1;
        }
    }
    if (event == ONE_LOST) {
        valid[drawn((unsigned)n)] = 0;
    }
    deviation += is(DEVIATION, event) ? DEVIATIONS : 0.0;
    const double of_flow = event == WITHOUT_PRESSURE ? 0.0 : ratio * pressure;
    return (Changes){{of_flow, is(NO_FIT, event) ? 1.3 * mach : 0.0}, event != ORDINARY, is(DEVIATION, event), 0, fmi2False};
}

static double timed_step(const Changes *changes)
{
    const fmi2ValueReference first = (fmi2ValueReference)(FIRST_STRAIN + 2 * n), flow[2] = {first, first + 2};
    fmi2Component fmu = track.fmu;
    const double start = seconds();
    const int good = fmi2SetReal(fmu, inputs, n, strain) == fmi2OK && fmi2SetReal(fmu, flow, 2, changes->of_flow) == fmi2OK
                  && (!changes->masks || fmi2SetBoolean(fmu, flags, n, valid) == fmi2OK)
                  && (!changes->deviates || fmi2SetReal(fmu, &zero, 1, &deviation) == fmi2OK)
                  && (!changes->tares || fmi2SetBoolean(fmu, &tare, 1, &changes->asks) == fmi2OK)
                  && step_and_read(&track, N_READ);
    const double taken = seconds() - start;
    check(good, "a step");
    return taken;
}

static double step(int event)
{
    const Changes changes = draw(event);
    if (is(COLD, event)) {
        begin(&track, filter > 0);
    }
    return timed_step(&changes);
}

/* All gauges, and zeros without errors, as after the start; the dearest of the steps that follow the event. */
static double undo(int event)
{
    const double none = 0.0;
    double dearest = 0.0;
    for (size_t k = 0; k < n; k++) {
        valid[k] = 1;
    }
    check(fmi2SetBoolean(track.fmu, flags, n, valid) == fmi2OK, "fmi2SetBoolean");
    for (int k = 0; is(DEVIATION, event) && k < BETWEEN; k++) {
        const double taken = step(ORDINARY);
        dearest = taken > dearest ? taken : dearest;
    }
    if (is(DEVIATION, event)) {
        check(fmi2SetReal(track.fmu, &zero, 1, &none) == fmi2OK, "fmi2SetReal");
    }
    for (int k = 0; k < BETWEEN; k++) {
        step(ORDINARY);
    }
    return dearest;
}

static void measure(int event)
{
    double *times = calloc(repeats, sizeof *times);
    for (size_t r = 0; r < repeats; r++) {
        const double first = step(event), after = undo(event);
        times[r] = first > after ? first : after;
    }
    const double middle = median(times, repeats);
    printf("%d %.6e %.6e\n", event, middle, times[repeats - 1]);
    free(times);
}

/* One of `count` steps, at random. */
static int chance(unsigned count)
{
    return drawn(count) == 0;
}

/* Let other gauges be valid: all, or some lost. */
static void draw_mask(void)
{
    const unsigned kind = drawn(10), lost = kind < 4 ? 0 : kind < 7 ? 1 : kind < 9 ? 1 + drawn(4) : (unsigned)n / 3;
    for (size_t k = 0; k < n; k++) {
        valid[k] = 1;
    }
    for (unsigned k = 0; k < lost; k++) {
        valid[drawn((unsigned)n)] = 0;
    }
}

/* What the steps at random are in: dynamic pressure over the nominal one, steps that are left of strain that does not fit,
   and of the window of a tare. */
static double motion = 1.0;
static unsigned off, window;

/* A step with events at random: other gauges, readings that are none, jumps, strain that does not fit, air data that is not
   known, other deviations of zeros, tares at rest. */
static double random_step(void)
{
    Changes changes = {.masks = chance(20), .deviates = chance(150), .tares = 1};
    const int begins = window == 0 && chance(3000);
    motion = chance(200) ? 0.7 + 0.8 * drawn(1000) / 1000.0 : motion + 2e-4 * (drawn(1001) / 1000.0 - 0.5);
    motion = motion < 0.7 ? 0.7 : motion > 1.5 ? 1.5 : motion;
    off = off > 0 ? off - 1 : chance(400) ? 1 + drawn(5) : 0;
    window = begins ? WINDOW : window > 0 ? window - 1 : 0;
    for (size_t k = 0; k < n; k++) {
        const double noise = 1e-7 * (drawn(2001) / 1000.0 - 1.0);
        strain[k] = noise + (window > 0 ? 0.0 : fixed_part[k] + motion * scaled_part[k] + (off > 0 ? (k % 2 ? OFF : -OFF) : 0.0));
    }
    if (chance(50)) {
        strain[drawn((unsigned)n)] = NAN;
    }
    if (changes.masks) {
        draw_mask();
    }
    deviation = changes.deviates ? DEVIATIONS * (1 + drawn(1000)) : deviation;
    changes.of_flow[0] = window > 0 || chance(300) ? 0.0 : motion * pressure;
    changes.of_flow[1] = off > 0 ? 1.3 * mach : chance(2) ? 0.0 : mach;
    changes.asks = window > 0;
    return timed_step(&changes);
}

static void worst(char **words)
{
    mach = strtod(words[0], NULL);
    tare = (fmi2ValueReference)strtoul(words[1], NULL, 10);
    const size_t steps = strtoul(words[2], NULL, 10);
    double *times = calloc(steps, sizeof *times);
    begin(&track, filter > 0);
    undo(ORDINARY);
    for (int event = 0; event < EVENTS; event++) {
        if (mach > 0.0 || event != WITHOUT_PRESSURE) { /* the linear estimator gives nothing then */
            measure(event);
        }
    }
    begin(&track, filter > 0);
    for (size_t k = 0; k < steps; k++) {
        times[k] = random_step();
    }
    const double middle = median(times, steps);
    printf("%d %.6e %.6e %.6e\n", EVENTS, middle, times[(size_t)(0.9999 * (double)(steps - 1))], times[steps - 1]);
    fmi2FreeInstance(track.fmu);
    free(times);
}

int main(int count, char **words)
{
    const int is_worst = count > 1 && strcmp(words[1], "worst") == 0, first = is_worst ? 12 : 11;
    check(count >= first + 2 && (count - first) % 2 == 0 && count <= first + 2 * MOST_GAUGES, "arguments");
    void *library = dlopen(words[2], RTLD_NOW);
    check(library != NULL, "dlopen");
#define FIND(name) name = (name##TYPE *)dlsym(library, #name);
    FUNCTIONS(FIND)
    guid = words[3];
    resources = words[4];
    pressure = strtod(words[5], NULL);
    filter = (fmi2ValueReference)strtoul(words[6], NULL, 10);
    repeats = strtoul(words[7], NULL, 10);
    zero = (fmi2ValueReference)strtoul(words[8], NULL, 10);
    n = (size_t)(count - first) / 2;
    for (size_t k = 0; k < n; k++) {
        inputs[k] = (fmi2ValueReference)(FIRST_STRAIN + k);
        flags[k] = (fmi2ValueReference)(FIRST_STRAIN + n + k);
        valid[k] = 1;
        fixed_part[k] = strtod(words[(size_t)first + k], NULL);
        scaled_part[k] = strtod(words[(size_t)first + n + k], NULL);
    }
    for (fmi2ValueReference k = 0; k < N_READ; k++) {
        read[k] = k;
    }
    (is_worst ? worst : usual)(words + 9);
    return 0;
}
