/* Memory and time of the estimator on this machine: what a flight program must set aside.

       measure [REPEATS]    201 steps of each event by default

   Memory: what sl_open takes from malloc and calloc, and what a step takes, counted by the linker's --wrap; the stack
   that sl_open and the steps use, on a stack that was filled before. Time: median and largest step of each event.
   The largest of many steps is no bound: caches, interrupts and other programs are in it. */

#define _POSIX_C_SOURCE 200809L
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "estimator/interface/strainload.h"
#include "map_data.h"
#include "samples.h"

/* Seconds of a clock. Where there is no POSIX, put a cycle counter of the processor here. */
static double seconds(void) {
#if defined(CLOCK_PROCESS_CPUTIME_ID)
    struct timespec now;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
#else
    return (double)clock() / (double)CLOCKS_PER_SEC;
#endif
}

/* Memory of the heap: blocks in use while counting is on. */
enum { MOST_BLOCKS = 64 };
static struct {
    void *address;
    size_t size;
} block[MOST_BLOCKS];
static size_t in_use, most_in_use, n_requests;
static int counting;

#if defined(WRAPPED)
void *__real_malloc(size_t size);
void *__real_calloc(size_t count, size_t size);
void __real_free(void *address);
void *__wrap_malloc(size_t size);
void *__wrap_calloc(size_t count, size_t size);
void __wrap_free(void *address);

static void *noted(void *address, size_t size) {
    size_t k = 0;
    while (k < MOST_BLOCKS - 1 && block[k].address != NULL) {
        k++;
    }
    block[k].address = address;
    block[k].size = size;
    in_use += size;
    most_in_use = in_use > most_in_use ? in_use : most_in_use;
    n_requests++;
    return address;
}

void *__wrap_malloc(size_t size) {
    return counting ? noted(__real_malloc(size), size) : __real_malloc(size);
}

void *__wrap_calloc(size_t count, size_t size) {
    const int outer = counting;
    counting = 0; /* it may call malloc */
    void *address = __real_calloc(count, size);
    counting = outer;
    return counting ? noted(address, count * size) : address;
}

void __wrap_free(void *address) {
    for (size_t k = 0; k < MOST_BLOCKS && address != NULL; k++) {
        if (block[k].address == address) {
            in_use -= block[k].size;
            block[k].address = NULL;
            break;
        }
    }
    __real_free(address);
}
#endif

/* Stack: of work done on a stack that is filled with a mark before; 0 where that cannot be done. */
static size_t nothing_done;

#if defined(__unix__)
#include <pthread.h>

enum { STACK_SIZE = 1 << 20, PAGE = 1 << 16, MARK = 0xA5 };
static unsigned char room[STACK_SIZE + PAGE];

static size_t on_marked_stack(void *(*work)(void *)) {
    unsigned char *stack = room + (PAGE - (uintptr_t)room % PAGE);
    pthread_attr_t attributes;
    pthread_t thread;
    size_t untouched = 0;
    memset(stack, MARK, STACK_SIZE);
    pthread_attr_init(&attributes);
    if (pthread_attr_setstack(&attributes, stack, STACK_SIZE) != 0
        || pthread_create(&thread, &attributes, work, NULL) != 0) {
        work(NULL);
        return 0;
    }
    pthread_join(thread, NULL);
    while (untouched < STACK_SIZE && stack[untouched] == MARK) {
        untouched++;
    }
    return STACK_SIZE - untouched;
}
#else
static size_t on_marked_stack(void *(*work)(void *)) {
    work(NULL);
    return 0;
}
#endif

static void *do_nothing(void *unused) {
    return unused;
}

static size_t stack_of(void *(*work)(void *)) {
    const size_t used = on_marked_stack(work);
    return used > nothing_done ? used - nothing_done : 0;
}

/* Events of a step. */
enum { ORDINARY, ONE_LOST, THIRD_LOST, NO_FIT, NO_AIR_DATA, FIRST, NEW_ZEROS, ALL_AT_ONCE, EVENTS };
static const char *const EVENT[EVENTS] = {
    "nothing",
    "one sensor lost, another one every time",
    "a third of the sensors lost, others every time",
    "strain that fits no flight",
    "no air data",
    "the first step, after sl_restart",
    "standard deviation of a zero offset changed",
    "the first, a third lost, no fit, zero offset: all at once",
};
enum { BETWEEN = 6 };
static const double STEP = 1e-3, CONSTANT = 1.0, OFF = 1e-4, STD = 1e-9;

static StrainLoad *handle;
static char text[SL_TEXT_SIZE];
static double *input, *output, *took, deviation, now;
static unsigned char *valid;
static size_t n_repeats = 201, position, first_zero;
static unsigned random_state = 1;
static double cost[2][EVENTS][2]; /* without and with the filter: median, largest */

/* From 0 up to, not including, `below`. */
static size_t drawn(size_t below) {
    random_state = random_state * 1103515245u + 12345u;
    return (random_state >> 8) % below;
}

static int has(int event, int asked) {
    return asked == event || (asked == ALL_AT_ONCE && (event == THIRD_LOST || event >= FIRST || event == NO_FIT));
}

static int find(int record, const char *name, SlField *field) {
    size_t k = 0;
    while (sl_field(handle, record, k, field) && strcmp(field->name, name) != 0) {
        k++;
    }
    return sl_field(handle, record, k, field) && field->count > 0;
}

static void draw(int event) {
    const size_t n = sl_size(handle, SL_INPUTS), rows = sl_size(handle, SL_ROWS), turn = 2 * sl_sample_count - 1;
    const size_t sample = position < sl_sample_count ? position : turn - position;
    position = (position + 1) % turn; /* the flight to its end, and back */
    memcpy(input, sl_sample_input + sample * n, n * sizeof *input);
    for (size_t k = 0; k < rows; k++) {
        input[k] *= 1.0 + 1e-3 * ((double)drawn(1000) / 1000.0 - 0.5);
        input[k] += has(NO_FIT, event) ? (k % 2 ? OFF : -OFF) : 0.0;
        valid[k] = !has(THIRD_LOST, event) || drawn(3) != 0;
    }
    if (event == ONE_LOST) {
        valid[drawn(rows)] = 0;
    }
    for (size_t k = rows; k < n && event == NO_AIR_DATA; k++) {
        input[k] = NAN;
    }
}

static double step(int event) {
    draw(event);
    if (has(FIRST, event)) {
        sl_restart(handle);
        now = 0.0;
    }
    deviation += STD;
    const double start = seconds();
    if (has(NEW_ZEROS, event)) {
        sl_set(handle, first_zero, 1, &deviation, text);
    }
    sl_step(handle, now, input, valid, output);
    const double end = seconds();
    now += STEP;
    return end - start;
}

static int by_size(const void *a, const void *b) {
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static void measure(int filtered, int event) {
    const double none = 0.0;
    for (size_t r = 0; r < n_repeats; r++) {
        took[r] = step(event);
        if (has(NEW_ZEROS, event)) {
            sl_set(handle, first_zero, 1, &none, text);
        }
        for (int k = 0; k < BETWEEN; k++) {
            step(ORDINARY);
        }
    }
    qsort(took, n_repeats, sizeof *took, by_size);
    cost[filtered][event][0] = took[n_repeats / 2];
    cost[filtered][event][1] = took[n_repeats - 1];
}

static void *open_map(void *unused) {
    counting = 1;
    handle = sl_open(sl_map_data, sl_map_size, text);
    counting = 0;
    return unused;
}

static void *measure_all(void *unused) {
    SlField constant;
    const int has_filter = find(SL_SETTINGS, "filter_time_constant", &constant);
    counting = 1;
    for (int filtered = 0; filtered <= has_filter; filtered++) {
        if (filtered) {
            sl_set(handle, constant.first, 1, &CONSTANT, text);
        }
        sl_restart(handle);
        for (int event = 0; event < EVENTS; event++) {
            measure(filtered, event);
        }
    }
    counting = 0;
    return unused;
}

/* Whether a buffer of the stated size is enough, without a request of memory. */
static int opens_in_buffer(void) {
    void *buffer = malloc(sl_size(handle, SL_MEMORY));
    const size_t before = n_requests;
    counting = 1;
    StrainLoad *other = buffer != NULL ? sl_open_in(sl_map_data, sl_map_size, buffer, sl_size(handle, SL_MEMORY), text) : NULL;
    sl_close(other);
    counting = 0;
    free(buffer);
    return other != NULL && n_requests == before;
}

static void print_memory(size_t of_opening) {
    printf("map_data.c %26lu bytes, constant\n", (unsigned long)sl_map_size);
    printf("a handle of sl_open_in %14lu bytes, no request\n", (unsigned long)sl_size(handle, SL_MEMORY));
    printf("iterations of a step %16lu at most\n", (unsigned long)sl_size(handle, SL_ITERATIONS));
#if defined(WRAPPED)
    printf("a handle %28lu bytes in %lu blocks, taken by sl_open\n", (unsigned long)most_in_use, (unsigned long)n_requests);
#else
    printf("a handle: not measured, this linker does not wrap functions\n");
#endif
    printf("records %29lu bytes: a sample and its outputs\n",
           (unsigned long)((sl_size(handle, SL_INPUTS) + sl_size(handle, SL_OUTPUTS)) * sizeof(double)));
    printf("state of a track %20lu bytes, if it is kept\n", (unsigned long)sl_size(handle, SL_STATE));
    if (of_opening > 0) {
        printf("stack of sl_open %20lu bytes\n", (unsigned long)of_opening);
    }
}

static void print_times(void) {
    const int has_filter = cost[1][ORDINARY][1] > 0.0;
    printf("\n%-60s%s\n", "us of a step, median to largest, when this happens", has_filter ? "           with the filter" : "");
    for (int event = 0; event < EVENTS; event++) {
        printf("%-60s", EVENT[event]);
        for (int filtered = 0; filtered <= has_filter; filtered++) {
            printf("%9.1f %9.1f  ", 1e6 * cost[filtered][event][0], 1e6 * cost[filtered][event][1]);
        }
        printf("\n");
    }
}

int main(int count, char **words) {
    SlField zero;
    nothing_done = on_marked_stack(do_nothing);
    const size_t of_opening = stack_of(open_map);
    n_repeats = count > 1 ? (size_t)strtoul(words[1], NULL, 10) : n_repeats;
    if (handle == NULL || n_repeats < 1) {
        fprintf(stderr, "measure: %s\n", handle == NULL ? text : "expected a number of repeats from 1 on");
        return 1;
    }
    input = calloc(sl_size(handle, SL_INPUTS), sizeof *input);
    output = calloc(sl_size(handle, SL_OUTPUTS), sizeof *output);
    valid = calloc(sl_size(handle, SL_ROWS), 1);
    took = calloc(n_repeats, sizeof *took);
    if (input == NULL || output == NULL || valid == NULL || took == NULL || !find(SL_SETTINGS, "zero_std", &zero)) {
        fprintf(stderr, "measure: needs more memory than there is\n");
        return 1;
    }
    first_zero = zero.first;
    print_memory(of_opening);
    const size_t of_opening_requests = n_requests, of_steps = stack_of(measure_all);
    if (of_steps > 0) {
        printf("stack of a step %21lu bytes at most\n", (unsigned long)of_steps);
    }
    if (of_opening > sl_size(handle, SL_STACK) || of_steps > sl_size(handle, SL_STACK) || !opens_in_buffer()) {
        fprintf(stderr, "measure: stack or buffer is larger than sl_size states\n");
        return 1;
    }
#if defined(WRAPPED)
    printf("requests of memory by steps %9lu\n", (unsigned long)(n_requests - of_opening_requests));
#else
    (void)of_opening_requests;
#endif
    print_times();
    free(input);
    free(output);
    free(valid);
    free(took);
    sl_close(handle);
    return 0;
}
