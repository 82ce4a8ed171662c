/* FMI 3.0: binary variables, clocks and counters of the port of an instance that has one.

   Data that are set count as ticked, in whatever order clock and data come; the same data set twice count once. A
   countdown clock states its interval once, and again after the state was set. Source: FMI 3.0.2, sections 2.2.8 and
   4.2; FMI-LS-BUS 1.0.0, section 5.3. */

#include "fmi3.h"

#include "../core/ports.h"

#define SHORTEST_INTERVAL 1e-6 /* [s]: importers differ about intervals of 0 */
#define ROUND_OFF 1e-9         /* of a time [s] */

enum { RX_DATA = FMI3_FIRST_PORT, TX_DATA, RX_CLOCK, TX_CLOCK, NOTIFICATIONS, FIRST_COUNTER = FMI3_FIRST_PORT + 16 };

/* Whether all references are the one of a kind of variable, and the instance is in one of the modes. */
static int are(Instance *s, const char *function, int modes, const fmi3ValueReference references[], size_t n,
               const void *values, unsigned wanted) {
    if (!instance_allows(s, function, modes) || (n > 0 && !instance_given(s, function, references))
        || (n > 0 && !instance_given(s, function, values))) {
        return 0;
    }
    for (size_t i = 0; i < n; i++) {
        if (s->node == NULL || references[i] != wanted) {
            fmi3_wrong_type(s, function, references[i]);
            return 0;
        }
    }
    return 1;
}

int fmi3_is_due(const Instance *s) {
    return s->node != NULL && PORTS.is_triggered(s->node) && PORTS.due(s->node) <= s->model->time + ROUND_OFF;
}

fmi3Status fmi3SetBinary(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                         const size_t valueSizes[], const fmi3Binary values[], size_t nValues) {
    static const char NAME[] = "fmi3SetBinary";
    Instance *s = instance;
    if (!are(s, NAME, FMI3_SETTABLE, valueReferences, nValueReferences, values, RX_DATA)
        || (nValueReferences > 0 && !instance_given(s, NAME, valueSizes))) {
        return fmi3Error;
    }
    for (size_t i = 0; i < nValues && i < nValueReferences; i++) {
        if (valueSizes[i] == 0 || s->model->mode != EVENT) {
            continue; /* start values, and what a clock without data brings */
        }
        if (!instance_given(s, NAME, values[i]) || !PORTS.hear(s->node, values[i], valueSizes[i])) {
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
    if (!are(s, NAME, FMI3_READABLE, valueReferences, nValueReferences, values, TX_DATA)
        || (nValueReferences > 0 && !instance_given(s, NAME, valueSizes))) {
        return fmi3Error;
    }
    for (size_t i = 0; i < nValues && i < nValueReferences; i++) {
        values[i] = PORTS.sealed(s->node, &valueSizes[i]);
    }
    return fmi3OK;
}

fmi3Status fmi3SetClock(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                        const fmi3Clock values[]) {
    static const char NAME[] = "fmi3SetClock";
    Instance *s = instance;
    for (size_t i = 0; i < nValueReferences; i++) {
        const int sends = valueReferences != NULL && valueReferences[i] == TX_CLOCK && s != NULL && s->node != NULL
                       && !PORTS.is_triggered(s->node);
        if (!are(s, NAME, EVENT, valueReferences + i, 1, values, sends ? TX_CLOCK : RX_CLOCK)) {
            return fmi3Error;
        }
        if (sends && values[i]) {
            PORTS.tick(s->node, s->model->time);
        }
    }
    return fmi3OK;
}

fmi3Status fmi3GetClock(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                        fmi3Clock values[]) {
    Instance *s = instance;
    if (!are(s, "fmi3GetClock", EVENT, valueReferences, nValueReferences, values, TX_CLOCK)) {
        return fmi3Error;
    }
    for (size_t i = 0; i < nValueReferences; i++) {
        if (fmi3_is_due(s)) {
            PORTS.tick(s->node, s->model->time);
        }
        size_t n;
        values[i] = PORTS.is_triggered(s->node) && PORTS.sealed(s->node, &n) != NULL;
    }
    return fmi3OK;
}

fmi3Status fmi3GetIntervalDecimal(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                                  size_t nValueReferences, fmi3Float64 intervals[],
                                  fmi3IntervalQualifier qualifiers[]) {
    static const char NAME[] = "fmi3GetIntervalDecimal";
    Instance *s = instance;
    if (!are(s, NAME, EVENT, valueReferences, nValueReferences, intervals, TX_CLOCK)
        || (nValueReferences > 0 && !instance_given(s, NAME, qualifiers))) {
        return fmi3Error;
    }
    for (size_t i = 0; i < nValueReferences; i++) {
        const double due = PORTS.due(s->node), left = due - s->model->time;
        intervals[i] = left > SHORTEST_INTERVAL ? left : SHORTEST_INTERVAL;
        qualifiers[i] = due == s->stated_due ? fmi3IntervalUnchanged : fmi3IntervalChanged;
        s->stated_due = due;
    }
    return fmi3OK;
}

fmi3Status fmi3GetUInt64(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                         fmi3UInt64 values[], size_t nValues) {
    Instance *s = instance;
    for (size_t i = 0; i < nValueReferences && i < nValues; i++) {
        const unsigned which = valueReferences == NULL ? N_PORT_COUNTERS : valueReferences[i] - FIRST_COUNTER;
        const unsigned known = FIRST_COUNTER + (which < N_PORT_COUNTERS ? which : 0);
        if (!are(s, "fmi3GetUInt64", FMI3_READABLE, valueReferences + i, 1, values, known)) {
            return fmi3Error;
        }
        values[i] = PORTS.counter(s->node, which);
    }
    return s != NULL ? fmi3OK : fmi3Error;
}
