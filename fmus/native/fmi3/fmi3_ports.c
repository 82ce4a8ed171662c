/* FMI 3.0: binary variables, clocks and counters of the ports of an instance that has any.

   Data that are set count as ticked, in whatever order clock and data come; the same data set twice count once. A
   countdown clock states its interval once, and again after the state was set. Source: FMI 3.0.2, sections 2.2.8 and
   4.2; FMI-LS-BUS 1.0.0, section 5.3. */

#include "fmi3.h"

#include <math.h>
#include <string.h>

#include "../core/ports.h"

#define SHORTEST_INTERVAL 1e-6 /* [s]: importers differ about intervals of 0 */
#define ROUND_OFF 1e-9         /* of a time [s] */

enum { RX_DATA, TX_DATA, RX_CLOCK, TX_CLOCK, FIRST_COUNTER = 16 };

/* Whether a function is allowed in the mode of the instance, with lists of so many references and values. */
static int may(Instance *s, const char *function, int modes, const fmi3ValueReference references[], size_t n,
               const void *values) {
    return instance_allows(s, function, modes)
        && (n == 0 || (instance_given(s, function, references) && instance_given(s, function, values)));
}

/* The port of a variable, and which of its variables it is, as a number; NULL, after a message, where there is none. */
static Link *port_of(Instance *s, const char *function, fmi3ValueReference reference, size_t *port, unsigned *member) {
    Link *link = NULL;
    if (s->node != NULL && reference >= FMI3_FIRST_PORT) {
        *port = (reference - FMI3_FIRST_PORT) / FMI3_REFERENCES_OF_PORT;
        *member = (reference - FMI3_FIRST_PORT) % FMI3_REFERENCES_OF_PORT;
        link = s->ports->link(s->node, *port);
    }
    if (link == NULL) {
        fmi3_wrong_type(s, function, reference);
    }
    return link;
}

/* The same of a certain variable of a port. */
static Link *wanted_of(Instance *s, const char *function, fmi3ValueReference reference, size_t *port, unsigned wanted) {
    unsigned member = wanted;
    Link *link = port_of(s, function, reference, port, &member);
    if (link != NULL && member != wanted) {
        fmi3_wrong_type(s, function, reference);
        return NULL;
    }
    return link;
}

static int is_due(const Instance *s, size_t port) {
    return s->ports->due(s->node, port) <= s->model->time + ROUND_OFF;
}

int fmi3_is_due(const Instance *s) {
    int due = 0;
    for (size_t port = 0; s->node != NULL && s->ports->is_triggered(s->node) && s->ports->link(s->node, port) != NULL; port++) {
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
    if (!may(s, NAME, FMI3_SETTABLE, valueReferences, nValueReferences, values)
        || (nValueReferences > 0 && !instance_given(s, NAME, valueSizes))) {
        return fmi3Error;
    }
    for (size_t i = 0; i < nValues && i < nValueReferences; i++) {
        size_t port;
        Link *link = wanted_of(s, NAME, valueReferences[i], &port, RX_DATA);
        if (link == NULL) {
            return fmi3Error;
        }
        if (valueSizes[i] == 0 || s->model->mode != EVENT) {
            continue; /* start values, and what a clock without data brings */
        }
        if (!instance_given(s, NAME, values[i]) || !hear(link, values[i], valueSizes[i])) {
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
    if (!may(s, NAME, FMI3_READABLE, valueReferences, nValueReferences, values)
        || (nValueReferences > 0 && !instance_given(s, NAME, valueSizes))) {
        return fmi3Error;
    }
    for (size_t i = 0; i < nValues && i < nValueReferences; i++) {
        size_t port;
        const Link *link = wanted_of(s, NAME, valueReferences[i], &port, TX_DATA);
        if (link == NULL) {
            return fmi3Error;
        }
        values[i] = link->is_ticking ? link->out : NULL;
        valueSizes[i] = link->is_ticking ? link->n_out : 0;
    }
    return fmi3OK;
}

fmi3Status fmi3SetClock(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                        const fmi3Clock values[]) {
    static const char NAME[] = "fmi3SetClock";
    Instance *s = instance;
    if (!may(s, NAME, EVENT, valueReferences, nValueReferences, values)) {
        return fmi3Error;
    }
    for (size_t i = 0; i < nValueReferences; i++) {
        size_t port;
        unsigned member;
        if (port_of(s, NAME, valueReferences[i], &port, &member) == NULL) {
            return fmi3Error;
        }
        if (member != RX_CLOCK && (member != TX_CLOCK || s->ports->is_triggered(s->node))) {
            return fmi3_wrong_type(s, NAME, valueReferences[i]);
        }
        if (member == TX_CLOCK && values[i]) {
            s->ports->tick(s->node, port, s->model->time);
            s->stated_due[port] = INFINITY;
        }
    }
    return fmi3OK;
}

fmi3Status fmi3GetClock(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                        fmi3Clock values[]) {
    static const char NAME[] = "fmi3GetClock";
    Instance *s = instance;
    if (!may(s, NAME, EVENT, valueReferences, nValueReferences, values)) {
        return fmi3Error;
    }
    for (size_t i = 0; i < nValueReferences; i++) {
        size_t port;
        const Link *link = wanted_of(s, NAME, valueReferences[i], &port, TX_CLOCK);
        if (link == NULL) {
            return fmi3Error;
        }
        if (s->ports->is_triggered(s->node) && is_due(s, port)) {
            s->ports->tick(s->node, port, s->model->time);
        }
        values[i] = s->ports->is_triggered(s->node) && link->is_ticking;
    }
    return fmi3OK;
}

fmi3Status fmi3GetIntervalDecimal(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                                  size_t nValueReferences, fmi3Float64 intervals[],
                                  fmi3IntervalQualifier qualifiers[]) {
    static const char NAME[] = "fmi3GetIntervalDecimal";
    Instance *s = instance;
    if (!may(s, NAME, EVENT, valueReferences, nValueReferences, intervals)
        || (nValueReferences > 0 && !instance_given(s, NAME, qualifiers))) {
        return fmi3Error;
    }
    for (size_t i = 0; i < nValueReferences; i++) {
        size_t port;
        if (wanted_of(s, NAME, valueReferences[i], &port, TX_CLOCK) == NULL) {
            return fmi3Error;
        }
        const double due = s->ports->due(s->node, port), left = due - s->model->time;
        const int is_known = due == s->stated_due[port];
        intervals[i] = due == INFINITY ? 0.0 : left > SHORTEST_INTERVAL ? left : SHORTEST_INTERVAL;
        qualifiers[i] = due == INFINITY ? fmi3IntervalNotYetKnown : is_known ? fmi3IntervalUnchanged : fmi3IntervalChanged;
        s->stated_due[port] = due;
    }
    return fmi3OK;
}

fmi3Status fmi3GetUInt64(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                         fmi3UInt64 values[], size_t nValues) {
    static const char NAME[] = "fmi3GetUInt64";
    Instance *s = instance;
    if (!may(s, NAME, FMI3_READABLE, valueReferences, nValueReferences, values)) {
        return fmi3Error;
    }
    for (size_t i = 0; i < nValueReferences && i < nValues; i++) {
        size_t port;
        unsigned member;
        const Link *link = port_of(s, NAME, valueReferences[i], &port, &member);
        if (link == NULL) {
            return fmi3Error;
        }
        if (member < FIRST_COUNTER || member >= FIRST_COUNTER + N_PORT_COUNTERS) {
            return fmi3_wrong_type(s, NAME, valueReferences[i]);
        }
        values[i] = link->counter[member - FIRST_COUNTER];
    }
    return fmi3OK;
}
