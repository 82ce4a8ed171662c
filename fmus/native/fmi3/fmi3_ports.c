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

/* The variable of a reference, which belongs to a port. */
static Member member_of(const Instance *s, fmi3ValueReference reference) {
    const size_t number = reference - FMI3_FIRST_PORT, port = number / FMI3_REFERENCES_OF_PORT;
    return (Member){node_link(s->node, port), port, number % FMI3_REFERENCES_OF_PORT};
}

static int is_of(const Instance *s, fmi3ValueReference reference, unsigned set) {
    const int has_ports = s->node != NULL && reference >= FMI3_FIRST_PORT;
    const Member member = has_ports ? member_of(s, reference) : (Member){NULL, 0, 0};
    return member.link != NULL && (set >> member.number & 1u);
}

/* Whether a function is allowed in the mode of the instance, with lists of so many references, of variables of a set, and
   values. If not, a message reports it. */
static int may(Instance *s, const char *function, int modes, unsigned set, const fmi3ValueReference references[], size_t n,
               const void *values, const void *more_values) {
    if (!instance_allows(s, function, modes) || !instance_lists(s, function, n, references, values)
        || !instance_lists(s, function, n, references, more_values)) {
        return 0;
    }
    for (size_t i = 0; i < n; i++) {
        if (!is_of(s, references[i], set)) {
            fmi3_wrong_type(s, function, references[i]);
            return 0;
        }
    }
    return 1;
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

fmi3Status fmi3SetBinary(VARIABLES, const size_t valueSizes[], const fmi3Binary values[], size_t nValues) {
    Instance *s = instance;
    if (!may(s, __func__, SETTABLE, RX_DATA, valueReferences, nValueReferences, values, valueSizes)) {
        return fmi3Error;
    }
    for (size_t i = 0; i < nValues && i < nValueReferences; i++) {
        if (valueSizes[i] == 0 || s->model->mode != EVENT) {
            continue; /* start values, and what a clock without data brings */
        }
        if (!instance_given(s, __func__, values[i])
            || !hear(member_of(s, valueReferences[i]).link, values[i], valueSizes[i])) {
            return (fmi3Status)instance_error(s, "%s: %lu bytes found, of all of an event at most %d are taken", __func__,
                                              (unsigned long)valueSizes[i], PORT_BYTES);
        }
    }
    return fmi3OK;
}

fmi3Status fmi3GetBinary(VARIABLES, size_t valueSizes[], fmi3Binary values[], size_t nValues) {
    Instance *s = instance;
    if (!may(s, __func__, READABLE, TX_DATA, valueReferences, nValueReferences, values, valueSizes)) {
        return fmi3Error;
    }
    for (size_t i = 0; i < nValues && i < nValueReferences; i++) {
        const Link *link = member_of(s, valueReferences[i]).link;
        values[i] = link->is_ticking ? link->out : NULL;
        valueSizes[i] = link->is_ticking ? link->n_out : 0;
    }
    return fmi3OK;
}

fmi3Status fmi3SetClock(VARIABLES, const fmi3Clock values[]) {
    Instance *s = instance;
    const unsigned clocks = s != NULL && is_triggered(s) ? RX_CLOCK : RX_CLOCK | TX_CLOCK;
    if (!may(s, __func__, EVENT, clocks, valueReferences, nValueReferences, values, values)) {
        return fmi3Error;
    }
    for (size_t i = 0; i < nValueReferences; i++) {
        const Member clock = member_of(s, valueReferences[i]);
        if ((TX_CLOCK >> clock.number & 1) && values[i]) {
            s->node->kind->tick(s->node, clock.port, s->model->time);
            s->stated_due[clock.port] = INFINITY;
        }
    }
    return fmi3OK;
}

fmi3Status fmi3GetClock(VARIABLES, fmi3Clock values[]) {
    Instance *s = instance;
    if (!may(s, __func__, EVENT, TX_CLOCK, valueReferences, nValueReferences, values, values)) {
        return fmi3Error;
    }
    for (size_t i = 0; i < nValueReferences; i++) {
        const Member clock = member_of(s, valueReferences[i]);
        if (is_triggered(s) && is_due(s, clock.port)) {
            s->node->kind->tick(s->node, clock.port, s->model->time);
        }
        values[i] = is_triggered(s) && clock.link->is_ticking;
    }
    return fmi3OK;
}

fmi3Status fmi3GetIntervalDecimal(VARIABLES, fmi3Float64 intervals[], fmi3IntervalQualifier qualifiers[]) {
    Instance *s = instance;
    if (!may(s, __func__, EVENT, TX_CLOCK, valueReferences, nValueReferences, intervals, qualifiers)) {
        return fmi3Error;
    }
    for (size_t i = 0; i < nValueReferences; i++) {
        const size_t port = member_of(s, valueReferences[i]).port;
        const double due = node_due(s->node, port), remaining = due - s->model->time;
        const int is_known = due == s->stated_due[port];
        intervals[i] = due == INFINITY ? 0.0 : remaining > SHORTEST_INTERVAL ? remaining : SHORTEST_INTERVAL;
        qualifiers[i] = due == INFINITY ? fmi3IntervalNotYetKnown : is_known ? fmi3IntervalUnchanged : fmi3IntervalChanged;
        s->stated_due[port] = due;
    }
    return fmi3OK;
}

fmi3Status fmi3GetUInt64(VARIABLES, fmi3UInt64 values[], size_t nValues) {
    Instance *s = instance;
    if (!may(s, __func__, READABLE, COUNTERS, valueReferences, nValueReferences, values, values)) {
        return fmi3Error;
    }
    for (size_t i = 0; i < nValueReferences && i < nValues; i++) {
        const Member counter = member_of(s, valueReferences[i]);
        values[i] = counter.link->counter[counter.number - FIRST_COUNTER];
    }
    return fmi3OK;
}
