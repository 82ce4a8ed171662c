/* FMI 3.0: binary variables, clocks and counters of the ports of an instance that has any.

   Data that are set count as ticked, in whatever order clock and data come; the same data set twice count once. A
   countdown clock states its interval once, and again after the state was set. Source: FMI 3.0.2, sections 2.2.8 and
   4.2; FMI-LS-BUS 1.0.0, section 5.3. */

#include "fmi3.h"

#include <math.h>
#include <string.h>

#define SHORTEST_INTERVAL 1e-6 /* [s]: importers differ about intervals of 0 */
#define ROUND_OFF 1e-9         /* of a time [s] */

/* Sets of the variables of a port: the bit of each is its number from the first one. */
enum { RX_DATA = 1, TX_DATA = 2, RX_CLOCK = 4, TX_CLOCK = 8 };
enum { FIRST_COUNTER = 16, COUNTERS = ((1 << N_PORT_COUNTERS) - 1) << FIRST_COUNTER };

/* A variable of a port. */
typedef struct {
    Link *link;
    size_t port, number;
} Member;

/* Whether a function is allowed in the mode of the instance, with lists of so many references and values. */
static int may(Instance *s, const char *function, int modes, const fmi3ValueReference references[], size_t n,
               const void *values, const void *more_values) {
    return instance_allows(s, function, modes) && instance_lists(s, function, n, references, values)
        && instance_lists(s, function, n, references, more_values);
}

/* Set `member` to the variable of a reference, which must be one of a set; 0, after a message, if it is not. */
static int is_member(Instance *s, const char *function, fmi3ValueReference reference, unsigned set, Member *member) {
    if (s->node != NULL && reference >= FMI3_FIRST_PORT) {
        member->port = (reference - FMI3_FIRST_PORT) / FMI3_REFERENCES_OF_PORT;
        member->number = (reference - FMI3_FIRST_PORT) % FMI3_REFERENCES_OF_PORT;
        member->link = node_link(s->node, member->port);
        if (member->link != NULL && (set >> member->number & 1u)) {
            return 1;
        }
    }
    fmi3_wrong_type(s, function, reference);
    return 0;
}

static int is_triggered(const Instance *s) {
    return s->node != NULL && s->node->setup->is_triggered;
}

static int is_due(const Instance *s, size_t port) {
    return node_due(s->node, port) <= s->model->time + ROUND_OFF;
}

int fmi3_is_due(const Instance *s) {
    int due = 0;
    for (size_t port = 0; is_triggered(s) && node_link(s->node, port) != NULL; port++) {
        due = due || is_due(s, port);
    }
    return due;
}

/* 0: there is no place for what was heard. */
static int hear(Link *link, const unsigned char *bytes, size_t n) {
    if (n <= link->n_heard && memcmp(link->heard + link->n_heard - n, bytes, n) == 0) {
        return 1; /* the same once more */
    }
    if (n > sizeof link->heard - link->n_heard) {
        return 0;
    }
    memcpy(link->heard + link->n_heard, bytes, n);
    link->n_heard += (uint32_t)n;
    return 1;
}

fmi3Status fmi3SetBinary(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                         const size_t valueSizes[], const fmi3Binary values[], size_t nValues) {
    static const char NAME[] = "fmi3SetBinary";
    Instance *s = instance;
    Member rx;
    if (!may(s, NAME, SETTABLE, valueReferences, nValueReferences, values, valueSizes)) {
        return fmi3Error;
    }
    for (size_t i = 0; i < nValues && i < nValueReferences; i++) {
        if (!is_member(s, NAME, valueReferences[i], RX_DATA, &rx)) {
            return fmi3Error;
        }
        if (valueSizes[i] == 0 || s->model->mode != EVENT) {
            continue; /* start values, and what a clock without data brings */
        }
        if (!instance_given(s, NAME, values[i]) || !hear(rx.link, values[i], valueSizes[i])) {
            return (fmi3Status)instance_error(s, "%s: %lu bytes found, of all of an event at most %d are taken", NAME,
                                              (unsigned long)valueSizes[i], PORT_BYTES);
        }
    }
    return fmi3OK;
}

fmi3Status fmi3GetBinary(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                         size_t valueSizes[], fmi3Binary values[], size_t nValues) {
    static const char NAME[] = "fmi3GetBinary";
    Instance *s = instance;
    Member tx;
    if (!may(s, NAME, READABLE, valueReferences, nValueReferences, values, valueSizes)) {
        return fmi3Error;
    }
    for (size_t i = 0; i < nValues && i < nValueReferences; i++) {
        if (!is_member(s, NAME, valueReferences[i], TX_DATA, &tx)) {
            return fmi3Error;
        }
        values[i] = tx.link->is_ticking ? tx.link->out : NULL;
        valueSizes[i] = tx.link->is_ticking ? tx.link->n_out : 0;
    }
    return fmi3OK;
}

fmi3Status fmi3SetClock(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                        const fmi3Clock values[]) {
    static const char NAME[] = "fmi3SetClock";
    Instance *s = instance;
    Member clock;
    if (!may(s, NAME, EVENT, valueReferences, nValueReferences, values, values)) {
        return fmi3Error;
    }
    for (size_t i = 0; i < nValueReferences; i++) {
        if (!is_member(s, NAME, valueReferences[i], is_triggered(s) ? RX_CLOCK : RX_CLOCK | TX_CLOCK, &clock)) {
            return fmi3Error;
        }
        if ((TX_CLOCK >> clock.number & 1) && values[i]) {
            s->node->kind->tick(s->node, clock.port, s->model->time);
            s->stated_due[clock.port] = INFINITY;
        }
    }
    return fmi3OK;
}

fmi3Status fmi3GetClock(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                        fmi3Clock values[]) {
    static const char NAME[] = "fmi3GetClock";
    Instance *s = instance;
    Member clock;
    if (!may(s, NAME, EVENT, valueReferences, nValueReferences, values, values)) {
        return fmi3Error;
    }
    for (size_t i = 0; i < nValueReferences; i++) {
        if (!is_member(s, NAME, valueReferences[i], TX_CLOCK, &clock)) {
            return fmi3Error;
        }
        if (is_triggered(s) && is_due(s, clock.port)) {
            s->node->kind->tick(s->node, clock.port, s->model->time);
        }
        values[i] = is_triggered(s) && clock.link->is_ticking;
    }
    return fmi3OK;
}

fmi3Status fmi3GetIntervalDecimal(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                                  size_t nValueReferences, fmi3Float64 intervals[],
                                  fmi3IntervalQualifier qualifiers[]) {
    static const char NAME[] = "fmi3GetIntervalDecimal";
    Instance *s = instance;
    Member clock;
    if (!may(s, NAME, EVENT, valueReferences, nValueReferences, intervals, qualifiers)) {
        return fmi3Error;
    }
    for (size_t i = 0; i < nValueReferences; i++) {
        if (!is_member(s, NAME, valueReferences[i], TX_CLOCK, &clock)) {
            return fmi3Error;
        }
        const double due = node_due(s->node, clock.port), remaining = due - s->model->time;
        const int is_known = due == s->stated_due[clock.port];
        intervals[i] = due == INFINITY ? 0.0 : remaining > SHORTEST_INTERVAL ? remaining : SHORTEST_INTERVAL;
        qualifiers[i] = due == INFINITY ? fmi3IntervalNotYetKnown : is_known ? fmi3IntervalUnchanged : fmi3IntervalChanged;
        s->stated_due[clock.port] = due;
    }
    return fmi3OK;
}

fmi3Status fmi3GetUInt64(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                         fmi3UInt64 values[], size_t nValues) {
    static const char NAME[] = "fmi3GetUInt64";
    Instance *s = instance;
    Member counter;
    if (!may(s, NAME, READABLE, valueReferences, nValueReferences, values, values)) {
        return fmi3Error;
    }
    for (size_t i = 0; i < nValueReferences && i < nValues; i++) {
        if (!is_member(s, NAME, valueReferences[i], COUNTERS, &counter)) {
            return fmi3Error;
        }
        values[i] = counter.link->counter[counter.number - FIRST_COUNTER];
    }
    return fmi3OK;
}
