/* Processor time of the dearest steps of an estimator FMU (FMI 2.0) in a C host: each event alone, all in one step, and
   events at random.

   worst_step LIBRARY GUID RESOURCES PRESSURE MACH ZERO FILTER TARE REPEATS STEPS STRAIN...: prints a line for each event
   that the FMU can have: its number, then median and largest of REPEATS steps in seconds; of the deviation of a zero, which
   is followed over several steps, the dearest of those. The last line is of STEPS steps with events at random: the number
   behind the last event, median, 99.99 % and largest. A step is fmi2SetReal of the n strains
   and of dynamic pressure and Mach number, of what the event changes, fmi2DoStep, fmi2GetReal of coefficients, loads and
   their deviations, fmi2GetInteger of the health state. Ordinary steps lie between those that are timed.

   PRESSURE is the nominal dynamic pressure [Pa]; MACH a Mach number of the map's tables, 0 without tables; ZERO the
   value reference of the first deviation of a zero; FILTER that of the filter's time constant, which is on then, 0 for
   none; TARE that of the input of the tare.
   STRAIN are n strains [m/m] that do not follow the dynamic pressure and n that do, at the nominal one. */

#define _POSIX_C_SOURCE 199309L
#include <dlfcn.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "fmi2FunctionTypes.h"

enum { N_READ = 20, HEALTH_STATE = 20, FIRST_STRAIN = 27, FIRST_WORD = 11, BETWEEN = 16, WINDOW = 80, MOST_GAUGES = 4096 };

/* Events of a step. */
enum { ORDINARY, ONE_LOST, THIRD_LOST, DEVIATION, COLD, NO_FIT, WITHOUT_PRESSURE, ALL_AT_ONCE, EVENTS };

static const double SIZE = 1e-3;       /* of a step [s] */
static const double CONSTANT = 10.0;   /* time constant of the filter [s] */
static const double OFF = 1e-4;        /* strain by which gauges are off, up and down [m/m] */
static const double DEVIATIONS = 1e-9; /* of a zero; each change by as much [m/m] */

#define FUNCTIONS(DO)                                                                                                  \
    DO(fmi2Instantiate)                                                                                                \
    DO(fmi2SetupExperiment)                                                                                            \
    DO(fmi2EnterInitializationMode)                                                                                    \
    DO(fmi2ExitInitializationMode)                                                                                     \
    DO(fmi2FreeInstance)                                                                                               \
    DO(fmi2SetReal)                                                                                                    \
    DO(fmi2SetBoolean)                                                                                                 \
    DO(fmi2DoStep)                                                                                                     \
    DO(fmi2GetReal)                                                                                                    \
    DO(fmi2GetInteger)
#define DECLARE(name) static name##TYPE *name;
FUNCTIONS(DECLARE)

static const char *guid, *resources;
static fmi2Component fmu;
static size_t n;
static double now_at, strain[MOST_GAUGES], fixed_part[MOST_GAUGES], scaled_part[MOST_GAUGES], pressure, mach, deviation;
static fmi2ValueReference inputs[MOST_GAUGES], flags[MOST_GAUGES], read[N_READ], zero, filter, tare;
static fmi2Boolean valid[MOST_GAUGES];
static unsigned random_state = 1;

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
        fprintf(stderr, "worst_step: %s failed\n", what);
        exit(1);
    }
}

static double seconds(void)
{
    struct timespec t;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

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

/* Inputs of a step with an event: a slow motion, of which the strains follow the dynamic pressure. */
static void draw(int event, double ratio)
{
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
}

/* A new instance in place of the last one, if any: it keeps nothing for a set of gauges or a dynamic pressure. */
static void begin(void)
{
    static const fmi2CallbackFunctions callbacks = {logger, calloc, free, NULL, NULL};
    if (fmu != NULL) {
        fmi2FreeInstance(fmu);
    }
    fmu = fmi2Instantiate("worst", fmi2CoSimulation, guid, resources, &callbacks, 0, 0);
    check(fmu != NULL && fmi2SetupExperiment(fmu, 0, 0.0, 0.0, 0, 0.0) == fmi2OK
              && fmi2EnterInitializationMode(fmu) == fmi2OK && fmi2ExitInitializationMode(fmu) == fmi2OK
              && (filter == 0 || fmi2SetReal(fmu, &filter, 1, &CONSTANT) == fmi2OK),
          "beginning");
    now_at = 0.0;
}

static double step(int event)
{
    const double ratio = 0.9 + 0.2 * drawn(1000) / 1000.0;
    const fmi2ValueReference first = (fmi2ValueReference)(FIRST_STRAIN + 2 * n), flow[2] = {first, first + 2};
    const fmi2ValueReference health = HEALTH_STATE;
    const int none = event == WITHOUT_PRESSURE;
    const double of_flow[2] = {none ? 0.0 : ratio * pressure, is(NO_FIT, event) ? 1.3 * mach : 0.0};
    double values[N_READ];
    fmi2Integer state;
    int good = 1;
    draw(event, ratio);
    if (is(COLD, event)) {
        begin();
    }
    const double start = seconds();
    good &= fmi2SetReal(fmu, inputs, n, strain) == fmi2OK && fmi2SetReal(fmu, flow, 2, of_flow) == fmi2OK;
    if (event != ORDINARY) {
        good &= fmi2SetBoolean(fmu, flags, n, valid) == fmi2OK;
    }
    if (is(DEVIATION, event)) {
        good &= fmi2SetReal(fmu, &zero, 1, &deviation) == fmi2OK;
    }
    good &= fmi2DoStep(fmu, now_at, SIZE, 1) == fmi2OK && fmi2GetReal(fmu, read, N_READ, values) == fmi2OK
         && fmi2GetInteger(fmu, &health, 1, &state) == fmi2OK;
    const double taken = seconds() - start;
    now_at += SIZE;
    check(good, "a step");
    return taken;
}

/* All gauges, and zeros without errors, as after the start; the dearest of the steps that follow the event. */
static double undo(int event)
{
    const double none = 0.0;
    double dearest = 0.0;
    for (size_t k = 0; k < n; k++) {
        valid[k] = 1;
    }
    check(fmi2SetBoolean(fmu, flags, n, valid) == fmi2OK, "fmi2SetBoolean");
    for (int k = 0; is(DEVIATION, event) && k < BETWEEN; k++) {
        const double taken = step(ORDINARY);
        dearest = taken > dearest ? taken : dearest;
    }
    if (is(DEVIATION, event)) {
        check(fmi2SetReal(fmu, &zero, 1, &none) == fmi2OK, "fmi2SetReal");
    }
    for (int k = 0; k < BETWEEN; k++) {
        step(ORDINARY);
    }
    return dearest;
}

static int by_size(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static void measure(int event, size_t repeats)
{
    double *times = calloc(repeats, sizeof *times);
    for (size_t r = 0; r < repeats; r++) {
        const double first = step(event), after = undo(event);
        times[r] = first > after ? first : after;
    }
    qsort(times, repeats, sizeof *times, by_size);
    printf("%d %.6e %.6e\n", event, times[repeats / 2], times[repeats - 1]);
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
    const fmi2ValueReference first = (fmi2ValueReference)(FIRST_STRAIN + 2 * n), flow[2] = {first, first + 2};
    const fmi2ValueReference health = HEALTH_STATE;
    const int masks = chance(20), deviates = chance(150), tares = window == 0 && chance(3000);
    double values[N_READ], of_flow[2];
    fmi2Boolean asks = fmi2True;
    fmi2Integer state;
    int good = 1;
    motion = chance(200) ? 0.7 + 0.8 * drawn(1000) / 1000.0 : motion + 2e-4 * (drawn(1001) / 1000.0 - 0.5);
    motion = motion < 0.7 ? 0.7 : motion > 1.5 ? 1.5 : motion;
    off = off > 0 ? off - 1 : chance(400) ? 1 + drawn(5) : 0;
    window = tares ? WINDOW : window > 0 ? window - 1 : 0;
    for (size_t k = 0; k < n; k++) {
        const double noise = 1e-7 * (drawn(2001) / 1000.0 - 1.0);
        strain[k] = noise + (window > 0 ? 0.0 : fixed_part[k] + motion * scaled_part[k] + (off > 0 ? (k % 2 ? OFF : -OFF) : 0.0));
    }
    if (chance(50)) {
        strain[drawn((unsigned)n)] = NAN;
    }
    if (masks) {
        draw_mask();
    }
    deviation = deviates ? DEVIATIONS * (1 + drawn(1000)) : deviation;
    of_flow[0] = window > 0 || chance(300) ? 0.0 : motion * pressure;
    of_flow[1] = off > 0 ? 1.3 * mach : chance(2) ? 0.0 : mach;
    asks = window > 0;
    const double start = seconds();
    good &= fmi2SetReal(fmu, inputs, n, strain) == fmi2OK && fmi2SetReal(fmu, flow, 2, of_flow) == fmi2OK
         && (!masks || fmi2SetBoolean(fmu, flags, n, valid) == fmi2OK)
         && (!deviates || fmi2SetReal(fmu, &zero, 1, &deviation) == fmi2OK) && fmi2SetBoolean(fmu, &tare, 1, &asks) == fmi2OK
         && fmi2DoStep(fmu, now_at, SIZE, 1) == fmi2OK && fmi2GetReal(fmu, read, N_READ, values) == fmi2OK
         && fmi2GetInteger(fmu, &health, 1, &state) == fmi2OK;
    const double taken = seconds() - start;
    now_at += SIZE;
    check(good, "a step");
    return taken;
}

static void measure_random(size_t steps)
{
    double *times = calloc(steps, sizeof *times);
    for (size_t k = 0; k < steps; k++) {
        times[k] = random_step();
    }
    qsort(times, steps, sizeof *times, by_size);
    printf("%d %.6e %.6e %.6e\n", EVENTS, times[steps / 2], times[(size_t)(0.9999 * (double)(steps - 1))], times[steps - 1]);
    free(times);
}

int main(int count, char **words)
{
    check(count >= FIRST_WORD + 2 && (count - FIRST_WORD) % 2 == 0 && count <= FIRST_WORD + 2 * MOST_GAUGES, "arguments");
    void *library = dlopen(words[1], RTLD_NOW);
    check(library != NULL, "dlopen");
#define FIND(name) name = (name##TYPE *)dlsym(library, #name);
    FUNCTIONS(FIND)
    guid = words[2];
    resources = words[3];
    pressure = strtod(words[4], NULL);
    mach = strtod(words[5], NULL);
    zero = (fmi2ValueReference)strtoul(words[6], NULL, 10);
    filter = (fmi2ValueReference)strtoul(words[7], NULL, 10);
    tare = (fmi2ValueReference)strtoul(words[8], NULL, 10);
    n = (size_t)(count - FIRST_WORD) / 2;
    for (size_t k = 0; k < n; k++) {
        inputs[k] = (fmi2ValueReference)(FIRST_STRAIN + k);
        flags[k] = (fmi2ValueReference)(FIRST_STRAIN + n + k);
        valid[k] = 1;
        fixed_part[k] = strtod(words[FIRST_WORD + k], NULL);
        scaled_part[k] = strtod(words[FIRST_WORD + n + k], NULL);
    }
    for (fmi2ValueReference k = 0; k < N_READ; k++) {
        read[k] = k;
    }
    begin();
    undo(ORDINARY);
    for (int event = 0; event < EVENTS; event++) {
        if (mach > 0.0 || event != WITHOUT_PRESSURE) { /* the linear estimator gives nothing then */
            measure(event, strtoul(words[9], NULL, 10));
        }
    }
    begin();
    measure_random(strtoul(words[10], NULL, 10));
    fmi2FreeInstance(fmu);
    return 0;
}
