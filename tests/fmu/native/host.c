/* A small importer in C: drives the native FMU of FMI 2.0 and writes what it returns, or measures what it costs.

     host GUID LOCATION GAUGES run STEPS SEED      outputs of STEPS random steps, raw float64, to standard output
     host GUID LOCATION GAUGES replay STEPS FILE   the same of STEPS inputs in a file: strains, valid and flow;
       [REFERENCE VALUE]                           first a parameter gets a value
     host GUID LOCATION GAUGES time STEPS          nanoseconds per step, and per instantiation
     host GUID LOCATION GAUGES many STEPS          200 instances, interleaved, states, freed out of order
     host GUID LOCATION GAUGES foreign 0 OTHER     states of the map in LOCATION and of that in OTHER, with one GUID
     host GUID LOCATION GAUGES endure STEPS        memory of one instance over many steps
     host GUID LOCATION GAUGES tare STEPS FIRST    what becomes of a tare, whose input has the number FIRST; its first zero
     host GUID LOCATION GAUGES threads STEPS       8 threads, each with instances of its own

   It is linked with the library's sources, so that sanitizers need no loader. With -DHOST_LOADS it loads a library
   instead, which is then the first argument. */

#define _POSIX_C_SOURCE 200112L

#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#ifdef HOST_LOADS
#include "loaded_library.h"
#else
#include "fmi2Functions.h"
#endif

#ifdef HOST_THREADS
#include <pthread.h>
#endif

#ifdef _WIN32
#include <fcntl.h>
#include <io.h>
#endif

#define N_OUTPUTS 27
#define N_FLOW 4 /* dynamic pressure, its deviation, Mach number, altitude */
#define MOST_GAUGES 512

typedef struct {
    const char *guid, *location;
    unsigned gauges;
} Setup;

static void check(int right, const char *what) {
    if (!right) {
        fprintf(stderr, "host: %s failed\n", what);
        exit(1);
    }
}

static void silent(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status, fmi2String category,
                   fmi2String message, ...) {
    (void)environment;
    (void)name;
    (void)status;
    (void)category;
    (void)message;
}

static const fmi2CallbackFunctions CALLBACKS = {silent, NULL, NULL, NULL, NULL};

static fmi2Component instance(const Setup *setup) {
    fmi2Component c = fmi2Instantiate("host", fmi2CoSimulation, setup->guid, setup->location, &CALLBACKS, 0, 0);
    check(c != NULL, "fmi2Instantiate");
    return c;
}

static fmi2Component started(const Setup *setup) {
    fmi2Component c = instance(setup);
    check(fmi2SetupExperiment(c, 0, 0.0, 0.0, 0, 0.0) == fmi2OK, "fmi2SetupExperiment");
    check(fmi2EnterInitializationMode(c) == fmi2OK, "fmi2EnterInitializationMode");
    check(fmi2ExitInitializationMode(c) == fmi2OK, "fmi2ExitInitializationMode");
    return c;
}

/* Uniform in [0, 1): splitmix64, the same numbers on every platform. */
static double uniform(uint64_t *state) {
    uint64_t z = (*state += 0x9E3779B97F4A7C15u);
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9u;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBu;
    return (double)((z ^ (z >> 31)) >> 11) / 9007199254740992.0;
}

/* Strains, validity, flow and navigation. */
static void set_inputs(fmi2Component c, unsigned n, const double *strain, const fmi2Boolean *valid,
                       const double *flow) {
    fmi2ValueReference reference[MOST_GAUGES];
    for (unsigned i = 0; i < n; i++) {
        reference[i] = N_OUTPUTS + i;
    }
    check(fmi2SetReal(c, reference, n, strain) == fmi2OK, "fmi2SetReal");
    for (unsigned i = 0; i < n; i++) {
        reference[i] += n;
    }
    check(fmi2SetBoolean(c, reference, n, valid) == fmi2OK, "fmi2SetBoolean");
    for (unsigned i = 0; i < N_FLOW; i++) {
        reference[i] = N_OUTPUTS + 2 * n + i;
    }
    check(fmi2SetReal(c, reference, N_FLOW, flow) == fmi2OK, "fmi2SetReal of flow");
}

/* Strains of some micrometres per metre, now and then a broken one, and a few gauges switched off. */
static void set_random(fmi2Component c, unsigned n, uint64_t *random, long step) {
    double strain[MOST_GAUGES];
    fmi2Boolean valid[MOST_GAUGES];
    for (unsigned i = 0; i < n; i++) {
        strain[i] = 2e-4 * (uniform(random) - 0.5);
        valid[i] = 1;
    }
    if (step % 5 == 0) {
        strain[(unsigned)(uniform(random) * n)] = uniform(random) < 0.5 ? NAN : 1.0;
    }
    for (int k = 0; k < step % 4; k++) {
        valid[(unsigned)(uniform(random) * n)] = 0;
    }
    const double pressure = 1e4 + 1e5 * uniform(random);
    const double deviation = step % 2 ? NAN : 1e3 * uniform(random);
    const double altitude = 1e4 + 2e4 * uniform(random);
    const double flow[N_FLOW] = {pressure, deviation, step % 3 ? NAN : 4.0 + 4.0 * uniform(random), altitude};
    set_inputs(c, n, strain, valid, flow);
}

static void get_outputs(fmi2Component c, double value[N_OUTPUTS]) {
    for (fmi2ValueReference v = 0; v < N_OUTPUTS; v++) {
        fmi2Integer whole = 0;
        if (v == 20 || (v > 22 && v < 26)) {
            check(fmi2GetInteger(c, &v, 1, &whole) == fmi2OK, "fmi2GetInteger");
            value[v] = whole;
        } else {
            check(fmi2GetReal(c, &v, 1, value + v) == fmi2OK, "fmi2GetReal");
        }
    }
}

static void step_and_write(fmi2Component c, long step) {
    double value[N_OUTPUTS];
    check(fmi2DoStep(c, 0.01 * (double)step, 0.01, 1) == fmi2OK, "fmi2DoStep");
    get_outputs(c, value);
    check(fwrite(value, sizeof value, 1, stdout) == 1, "fwrite");
}

static void run(const Setup *setup, long steps, uint64_t seed) {
    fmi2Component c = started(setup);
    for (long k = 0; k < steps; k++) {
        set_random(c, setup->gauges, &seed, k);
        step_and_write(c, k);
    }
    fmi2FreeInstance(c);
}

/* Each step of the file: float64 strains, as many float64 that are 0 or 1, flow and navigation. */
static void replay(const Setup *setup, long steps, const char *path, int n_values, char **values) {
    const unsigned n = setup->gauges;
    double inputs[2 * MOST_GAUGES + N_FLOW];
    fmi2Boolean valid[MOST_GAUGES];
    fmi2Component c = started(setup);
    for (int k = 0; k + 1 < n_values; k += 2) {
        const fmi2ValueReference reference = (fmi2ValueReference)strtoul(values[k], NULL, 10);
        const double value = strtod(values[k + 1], NULL);
        check(fmi2SetReal(c, &reference, 1, &value) == fmi2OK, "fmi2SetReal of a value that stays");
    }
    FILE *file = fopen(path, "rb");
    check(file != NULL, "fopen");
    for (long k = 0; k < steps; k++) {
        check(fread(inputs, sizeof *inputs, 2 * n + N_FLOW, file) == 2 * n + N_FLOW, "fread");
        for (unsigned i = 0; i < n; i++) {
            valid[i] = inputs[n + i] > 0.0;
        }
        set_inputs(c, n, inputs, valid, inputs + 2 * n);
        step_and_write(c, k);
    }
    fclose(file);
    fmi2FreeInstance(c);
}

#ifndef _WIN32
/* Of the processor, so that other programs on the machine count little. */
static double seconds(void) {
    struct timespec now;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

static void measure(const Setup *setup, long steps) {
    const unsigned n = setup->gauges;
    fmi2ValueReference inputs[MOST_GAUGES], outputs[5] = {0, 1, 2, 3, 4}, health = 20, chi_square = 21;
    double strain[MOST_GAUGES], value[5], best[3] = {1e9, 1e9, 1e9}, sum = 0.0;
    uint64_t random = 1;
    for (unsigned i = 0; i < n; i++) {
        inputs[i] = N_OUTPUTS + i;
        strain[i] = 2e-6 * (uniform(&random) - 0.5);
    }
    fmi2Component c = started(setup);
    /* The host knows no strains that fit the map: alarm levels so high that health is OK, as it is in most steps. */
    const fmi2ValueReference alarm_scale = N_OUTPUTS + 2 * n + N_FLOW + 1;
    const double high = 1e9;
    check(fmi2SetReal(c, &alarm_scale, 1, &high) == fmi2OK, "fmi2SetReal of alarm_scale");
    for (int round = 0; round < 20; round++) {
        const double start = seconds();
        for (long k = 0; k < steps; k++) {
            fmi2Integer state;
            strain[k % n] += 1e-9;
            fmi2SetReal(c, inputs, n, strain);
            fmi2DoStep(c, (double)k, 1.0, 1);
            fmi2GetReal(c, outputs, 5, value);
            fmi2GetReal(c, &chi_square, 1, value + 4);
            fmi2GetInteger(c, &health, 1, &state);
            sum += value[0] + state;
        }
        const double step = (seconds() - start) / (double)steps;
        best[0] = step < best[0] ? step : best[0];
        const double before = seconds();
        for (int k = 0; k < 10; k++) {
            fmi2FreeInstance(instance(setup));
        }
        const double made = (seconds() - before) / 10.0;
        best[1] = made < best[1] ? made : best[1];
        /* A set of gauges that is not in the cache. */
        const double first = seconds();
        for (unsigned k = 0; k < 10; k++) {
            const fmi2ValueReference lost[2] = {N_OUTPUTS + n + k % n, N_OUTPUTS + n + (k + 7) % n};
            const fmi2Boolean off[2] = {0, 0}, on[2] = {1, 1};
            fmi2SetBoolean(c, lost, 2, off);
            fmi2GetReal(c, outputs, 5, value);
            fmi2SetBoolean(c, lost, 2, on);
        }
        const double masked = (seconds() - first) / 10.0;
        best[2] = masked < best[2] ? masked : best[2];
    }
    fmi2FreeInstance(c);
    printf("step %.1f ns, instantiate %.1f us, new mask of two %.1f us (%g)\n", 1e9 * best[0], 1e6 * best[1],
           1e6 * best[2], sum);
}
#endif

#define MANY 200

/* The state of each instance goes, in bytes, to another one, which must then give the same outputs. */
static void many(const Setup *setup, long steps) {
    static fmi2Component c[MANY];
    uint64_t random[MANY];
    double value[N_OUTPUTS], again[N_OUTPUTS];
    for (unsigned k = 0; k < MANY; k++) {
        c[k] = started(setup);
        random[k] = k;
    }
    for (long step = 0; step < steps; step++) {
        for (unsigned k = 0; k < MANY; k++) {
            fmi2FMUstate state = NULL, copy = NULL;
            size_t size;
            set_random(c[k], setup->gauges, &random[k], step + (long)k);
            check(fmi2DoStep(c[k], (double)step, 1.0, 1) == fmi2OK, "fmi2DoStep");
            get_outputs(c[k], value);
            check(fmi2GetFMUstate(c[k], &state) == fmi2OK, "fmi2GetFMUstate");
            check(fmi2SerializedFMUstateSize(c[k], state, &size) == fmi2OK, "fmi2SerializedFMUstateSize");
            char *bytes = malloc(size);
            check(bytes != NULL && fmi2SerializeFMUstate(c[k], state, bytes, size) == fmi2OK, "serialising");
            const unsigned other = (k * 7 + 3) % MANY;
            fmi2FMUstate before = NULL;
            check(fmi2GetFMUstate(c[other], &before) == fmi2OK, "fmi2GetFMUstate");
            check(fmi2DeSerializeFMUstate(c[other], bytes, size, &copy) == fmi2OK, "fmi2DeSerializeFMUstate");
            check(fmi2SetFMUstate(c[other], copy) == fmi2OK, "fmi2SetFMUstate");
            get_outputs(c[other], again);
            check(memcmp(value, again, sizeof value) == 0, "same state, same outputs");
            check(fmi2SetFMUstate(c[other], before) == fmi2OK, "fmi2SetFMUstate");
            fmi2FreeFMUstate(c[other], &before);
            fmi2FreeFMUstate(c[k], &copy);
            fmi2FreeFMUstate(c[other], &state);
            free(bytes);
        }
    }
    for (unsigned k = 0; k < MANY; k++) {
        fmi2FreeInstance(c[(k * 77 + 5) % MANY]);
    }
    puts("many: same");
}

/* Neither of two instances of different maps may touch the state of the other: every such call is refused. */
static void foreign(const Setup *setup, const char *other) {
    const Setup there = {setup->guid, other, setup->gauges};
    fmi2Component c[2] = {started(setup), started(&there)};
    fmi2FMUstate state[2] = {NULL, NULL};
    char *bytes[2];
    size_t size[2];
    for (int k = 0; k < 2; k++) {
        check(fmi2GetFMUstate(c[k], &state[k]) == fmi2OK, "fmi2GetFMUstate");
        check(fmi2SerializedFMUstateSize(c[k], state[k], &size[k]) == fmi2OK, "fmi2SerializedFMUstateSize");
        bytes[k] = malloc(size[k]);
        check(bytes[k] != NULL && fmi2SerializeFMUstate(c[k], state[k], bytes[k], size[k]) == fmi2OK, "serialising");
    }
    for (int k = 0; k < 2; k++) {
        const int o = 1 - k;
        check(fmi2GetFMUstate(c[k], &state[o]) == fmi2Error, "refusing fmi2GetFMUstate");
        check(fmi2SetFMUstate(c[k], state[o]) == fmi2Error, "refusing fmi2SetFMUstate");
        check(fmi2SerializeFMUstate(c[k], state[o], bytes[k], size[k]) == fmi2Error, "refusing fmi2SerializeFMUstate");
        check(fmi2DeSerializeFMUstate(c[k], bytes[k], size[k], &state[o]) == fmi2Error, "refusing a foreign state");
        check(fmi2DeSerializeFMUstate(c[k], bytes[o], size[o], &state[k]) == fmi2Error, "refusing foreign bytes");
    }
    for (int k = 0; k < 2; k++) {
        check(fmi2SetFMUstate(c[k], state[k]) == fmi2OK, "fmi2SetFMUstate");
        fmi2FreeFMUstate(c[k], &state[k]);
        fmi2FreeInstance(c[k]);
        free(bytes[k]);
    }
    puts("foreign: refused");
}

/* Resident memory in pages; 0 where the system does not report it. */
static long resident_pages(void) {
    long total = 0, resident = 0;
    FILE *file = fopen("/proc/self/statm", "r");
    if (file != NULL) {
        if (fscanf(file, "%ld %ld", &total, &resident) != 2) {
            resident = 0;
        }
        fclose(file);
    }
    return resident;
}

/* One instance for long: what it holds after a tenth of the steps, and at the end. */
static void endure(const Setup *setup, long steps) {
    fmi2Component c = started(setup);
    uint64_t random = 9;
    double value[N_OUTPUTS], sum = 0.0;
    long before = 0;
    for (long k = 0; k < steps; k++) {
        fmi2FMUstate state = NULL;
        if (k == steps / 10) {
            before = resident_pages();
        }
        if (k % 64 == 0) {
            set_random(c, setup->gauges, &random, k / 64);
            fmi2GetFMUstate(c, &state);
            fmi2FreeFMUstate(c, &state);
        }
        const fmi2ValueReference first = N_OUTPUTS;
        const double strain = 1e-9 * (double)k;
        fmi2SetReal(c, &first, 1, &strain);
        check(fmi2DoStep(c, (double)k, 1.0, 1) == fmi2OK, "fmi2DoStep");
        get_outputs(c, value);
        sum += value[0];
    }
    printf("endure: %ld pages, then %ld (%g)\n", before, resident_pages(), sum);
    fmi2FreeInstance(c);
}

/* A window of random zeros; in its middle the state goes to the other instance, which ends it. */
static void tare(const Setup *setup, long steps, fmi2ValueReference asked) {
    fmi2Component one = started(setup), other = started(setup);
    const fmi2ValueReference said = asked + 1, used = asked + 2;
    const fmi2ValueReference pressure = N_OUTPUTS + 2 * setup->gauges;
    const fmi2Boolean yes = fmi2True, no = fmi2False;
    const double rest = 0.0;
    uint64_t random = 3;
    for (long k = 0; k <= steps; k++) {
        fmi2Component c = k <= steps / 2 ? one : other;
        fmi2FMUstate state = NULL;
        if (k == steps / 2 + 1) {
            check(fmi2GetFMUstate(one, &state) == fmi2OK && fmi2SetFMUstate(c, state) == fmi2OK, "states");
            fmi2FreeFMUstate(one, &state);
        }
        for (unsigned i = 0; i < setup->gauges; i++) {
            const fmi2ValueReference gauge = N_OUTPUTS + i;
            const double strain = 1e-6 * (double)((7 * i) % 5) + 1e-9 * uniform(&random);
            fmi2SetReal(c, &gauge, 1, &strain);
        }
        fmi2SetReal(c, &pressure, 1, &rest);
        check(fmi2SetBoolean(c, &asked, 1, k < steps ? &yes : &no) == fmi2OK, "fmi2SetBoolean of the tare");
        check(fmi2DoStep(c, (double)k, 1.0, 1) == fmi2OK, "fmi2DoStep");
    }
    fmi2Integer outcome = -1;
    double zero = 0.0, value[N_OUTPUTS];
    check(fmi2GetInteger(other, &said, 1, &outcome) == fmi2OK && fmi2GetReal(other, &used, 1, &zero) == fmi2OK, "tare");
    get_outputs(other, value);
    printf("tare: %d %g\n", outcome, zero);
    fmi2FreeInstance(one);
    fmi2FreeInstance(other);
}

#ifdef HOST_THREADS
#define THREADS 8

static long thread_steps;

static void *work(void *argument) {
    const Setup *setup = argument;
    for (int k = 0; k < 3; k++) {
        fmi2Component c = started(setup);
        uint64_t random = 5;
        double value[N_OUTPUTS];
        for (long step = 0; step < thread_steps; step++) {
            set_random(c, setup->gauges, &random, step);
            check(fmi2DoStep(c, (double)step, 1.0, 1) == fmi2OK, "fmi2DoStep");
            get_outputs(c, value);
        }
        fmi2FreeInstance(c);
    }
    return NULL;
}

static void threads(Setup *setup, long steps) {
    pthread_t thread[THREADS];
    thread_steps = steps;
    for (int k = 0; k < THREADS; k++) {
        check(pthread_create(&thread[k], NULL, work, setup) == 0, "pthread_create");
    }
    for (int k = 0; k < THREADS; k++) {
        pthread_join(thread[k], NULL);
    }
    puts("threads: done");
}
#endif

int main(int argc, char **argv) {
#ifdef HOST_LOADS
    check(argc > 1, "arguments");
    load_library(*++argv);
    argc--;
#endif
#ifdef _WIN32
    _setmode(_fileno(stdout), _O_BINARY);
#endif
    check(argc >= 6, "arguments");
    Setup setup = {argv[1], argv[2], (unsigned)strtoul(argv[3], NULL, 10)};
    const char *task = argv[4];
    const long steps = strtol(argv[5], NULL, 10);
    check(setup.gauges > 0 && setup.gauges <= MOST_GAUGES, "number of gauges");
    if (strcmp(task, "run") == 0) {
        run(&setup, steps, argc > 6 ? strtoull(argv[6], NULL, 10) : 1);
    } else if (strcmp(task, "replay") == 0 && argc > 6) {
        replay(&setup, steps, argv[6], argc - 7, argv + 7);
    } else if (strcmp(task, "many") == 0) {
        many(&setup, steps);
    } else if (strcmp(task, "foreign") == 0 && argc > 6) {
        foreign(&setup, argv[6]);
    } else if (strcmp(task, "endure") == 0) {
        endure(&setup, steps);
    } else if (strcmp(task, "tare") == 0 && argc > 6) {
        tare(&setup, steps, (fmi2ValueReference)strtoul(argv[6], NULL, 10));
#ifndef _WIN32
    } else if (strcmp(task, "time") == 0) {
        measure(&setup, steps);
#endif
#ifdef HOST_THREADS
    } else if (strcmp(task, "threads") == 0) {
        threads(&setup, steps);
#endif
    } else {
        check(0, "task");
    }
    return 0;
}
