/* Variables of FMI 3.0: getting, setting and derivatives. */

#include "fmi3_common.h"

#include <string.h>

/* Each variable follows the one before it without a gap. */
Span fmi3_span(const Estimator *e, fmi3ValueReference reference) {
    static const unsigned char FIRST[] = {
        0,  5,                      /* coefficients, sigma_coefficients */
        10, 13, 15, 18,             /* forces, moments, sigma_forces, sigma_moments */
        20, 21, 22, 23, 24, 25,     /* health.state, .chi_square, .chi_square_limit, .valid_gauges, ... */
        N_OUTPUTS,                  /* strain; valid, then scalar inputs and settings */
    };
    const size_t n = e->map.n_gauges, strain = sizeof FIRST - 1;
    Span span = {0, 0};
    if (reference < strain) {
        span.first = FIRST[reference];
        span.count = (size_t)FIRST[reference + 1] - span.first;
    } else if (reference < strain + 2) {
        span.first = N_OUTPUTS + (reference - strain) * n;
        span.count = n;
    } else if (reference < TIME_REFERENCE) {
        span.first = N_OUTPUTS + 2 * n + (reference - strain - 2);
        span.count = 1;
    }
    return span;
}

int fmi3_given(const Instance *instance, const char *function, const void *argument) {
    if (argument == NULL) {
        instance_error(instance, "%s: an argument is NULL", function);
    }
    return argument != NULL;
}

fmi3Status fmi3_wrong_type(const Instance *instance, const char *function) {
    return (fmi3Status)instance_error(instance, "%s: a value reference is no variable of that type", function);
}

int fmi3_lists_fit(Instance *instance, const char *function, int modes, const fmi3ValueReference references[],
                   size_t nReferences, const void *values, size_t nValues) {
    if (!instance_allows(instance, function, modes) || (nReferences > 0 && !fmi3_given(instance, function, references))
        || (nValues > 0 && !fmi3_given(instance, function, values))) {
        return 0;
    }
    size_t wanted = 0;
    for (size_t i = 0; i < nReferences; i++) {
        const size_t count = fmi3_span(instance->estimator, references[i]).count;
        if (count == 0 && references[i] != TIME_REFERENCE) {
            fmi3_wrong_type(instance, function);
            return 0;
        }
        wanted += count > 0 ? count : 1;
    }
    if (wanted != nValues) {
        instance_error(instance, "%s: %lu values found, the variables have %lu", function, (unsigned long)nValues,
                       (unsigned long)wanted);
    }
    return wanted == nValues;
}

fmi3Status fmi3GetFloat64(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                          fmi3Float64 values[], size_t nValues) {
    Instance *s = instance;
    if (!fmi3_lists_fit(s, "fmi3GetFloat64", FMI3_READABLE, valueReferences, nValueReferences, values, nValues)) {
        return fmi3Error;
    }
    for (size_t i = 0; i < nValueReferences; i++) {
        const Span span = fmi3_span(s->estimator, valueReferences[i]);
        if (span.count == 0) {
            *values++ = s->time;
        } else if (!get_reals(s->estimator, span.first, span.count, values)) {
            return fmi3_wrong_type(s, "fmi3GetFloat64");
        }
        values += span.count;
    }
    return fmi3OK;
}

fmi3Status fmi3SetFloat64(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                          const fmi3Float64 values[], size_t nValues) {
    Instance *s = instance;
    char text[MAP_TEXT_SIZE];
    if (!fmi3_lists_fit(s, "fmi3SetFloat64", FMI3_SETTABLE, valueReferences, nValueReferences, values, nValues)) {
        return fmi3Error;
    }
    for (size_t i = 0; i < nValueReferences; i++) {
        const Span span = fmi3_span(s->estimator, valueReferences[i]);
        if (span.count == 0) {
            return (fmi3Status)instance_error(s, "fmi3SetFloat64: time cannot be set");
        }
        if (!set_reals(s->estimator, span.first, span.count, values, text)) {
            return (fmi3Status)instance_error(s, "fmi3SetFloat64: value reference %lu: %s",
                                              (unsigned long)valueReferences[i], text);
        }
        values += span.count;
    }
    return fmi3OK;
}

/* Integers other than the enumeration, or the enumeration alone: each has its own type in FMI 3.0. */
static int get_whole(Instance *s, fmi3ValueReference reference, int enumeration, int *value) {
    const size_t variable = fmi3_span(s->estimator, reference).first;
    return (variable == HEALTH_STATE) == enumeration && reference != TIME_REFERENCE
        && get_integer(s->estimator, variable, value);
}

fmi3Status fmi3GetInt32(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                        fmi3Int32 values[], size_t nValues) {
    Instance *s = instance;
    if (!fmi3_lists_fit(s, "fmi3GetInt32", FMI3_READABLE, valueReferences, nValueReferences, values, nValues)) {
        return fmi3Error;
    }
    for (size_t i = 0; i < nValueReferences; i++) {
        int value;
        if (!get_whole(s, valueReferences[i], 0, &value)) {
            return fmi3_wrong_type(s, "fmi3GetInt32");
        }
        values[i] = value;
    }
    return fmi3OK;
}

/* Enumerations are read as 64-bit integers. */
fmi3Status fmi3GetInt64(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                        fmi3Int64 values[], size_t nValues) {
    Instance *s = instance;
    if (!fmi3_lists_fit(s, "fmi3GetInt64", FMI3_READABLE, valueReferences, nValueReferences, values, nValues)) {
        return fmi3Error;
    }
    for (size_t i = 0; i < nValueReferences; i++) {
        int value;
        if (!get_whole(s, valueReferences[i], 1, &value)) {
            return fmi3_wrong_type(s, "fmi3GetInt64");
        }
        values[i] = value;
    }
    return fmi3OK;
}

fmi3Status fmi3GetBoolean(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                          fmi3Boolean values[], size_t nValues) {
    Instance *s = instance;
    if (!fmi3_lists_fit(s, "fmi3GetBoolean", FMI3_READABLE, valueReferences, nValueReferences, values, nValues)) {
        return fmi3Error;
    }
    for (size_t i = 0; i < nValueReferences; i++) {
        const Span span = fmi3_span(s->estimator, valueReferences[i]);
        for (size_t k = 0; k < span.count; k++) {
            int value;
            if (!get_boolean(s->estimator, span.first + k, &value)) {
                return fmi3_wrong_type(s, "fmi3GetBoolean");
            }
            *values++ = value != 0;
        }
    }
    return fmi3OK;
}

fmi3Status fmi3SetBoolean(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                          const fmi3Boolean values[], size_t nValues) {
    Instance *s = instance;
    char text[MAP_TEXT_SIZE];
    if (!fmi3_lists_fit(s, "fmi3SetBoolean", FMI3_SETTABLE, valueReferences, nValueReferences, values, nValues)) {
        return fmi3Error;
    }
    for (size_t i = 0; i < nValueReferences; i++) {
        const Span span = fmi3_span(s->estimator, valueReferences[i]);
        for (size_t k = 0; k < span.count; k++) {
            if (!set_boolean(s->estimator, span.first + k, *values++, text)) {
                return (fmi3Status)instance_error(s, "fmi3SetBoolean: value reference %lu: %s",
                                                  (unsigned long)valueReferences[i], text);
            }
        }
    }
    return fmi3OK;
}
