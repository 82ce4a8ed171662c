/* Partial derivatives in FMI 3.0. */

#include "fmi3_common.h"

#include <string.h>

/* Number of elements of the variables listed, if they are real outputs, or real inputs and settings; SIZE_MAX if one
   is neither. */
static size_t elements(const Estimator *e, const fmi3ValueReference references[], size_t count, int outputs) {
    size_t total = 0;
    for (size_t i = 0; i < count; i++) {
        const Span span = fmi3_span(e, references[i]);
        const int fits = outputs ? is_real_output(span.first) : input_place(e, span.first) != SIZE_MAX;
        if (span.count == 0 || !fits) {
            return SIZE_MAX;
        }
        total += span.count;
    }
    return total;
}

/* Whether the arguments fit, nOfUnknowns and nOfKnowns being the numbers of elements that the caller gives. */
static int arguments_fit(Instance *s, const char *function, const fmi3ValueReference unknowns[], size_t nUnknowns,
                         size_t nOfUnknowns, const fmi3ValueReference knowns[], size_t nKnowns, size_t nOfKnowns,
                         const double seed[], const double sensitivity[]) {
    if (!instance_allows(s, function, INITIALIZATION | FMI3_RUNNING) || !fmi3_given(s, function, unknowns)
        || !fmi3_given(s, function, knowns) || !fmi3_given(s, function, seed)
        || !fmi3_given(s, function, sensitivity)) {
        return 0;
    }
    if (elements(s->estimator, unknowns, nUnknowns, 1) != nOfUnknowns
        || elements(s->estimator, knowns, nKnowns, 0) != nOfKnowns) {
        instance_error(s, "%s: derivatives are those of real outputs by real inputs and parameters, as many values as "
                          "these have elements", function);
        return 0;
    }
    return 1;
}

/* Set the direction to zero. */
static double *no_direction(Instance *s) {
    return memset(s->direction, 0, (s->estimator->map.n_gauges + N_SCALAR_INPUTS) * sizeof *s->direction);
}

fmi3Status fmi3GetDirectionalDerivative(fmi3Instance instance, const fmi3ValueReference unknowns[], size_t nUnknowns,
                                        const fmi3ValueReference knowns[], size_t nKnowns, const fmi3Float64 seed[],
                                        size_t nSeed, fmi3Float64 sensitivity[], size_t nSensitivity) {
    Instance *s = instance;
    if (!arguments_fit(s, "fmi3GetDirectionalDerivative", unknowns, nUnknowns, nSensitivity, knowns, nKnowns, nSeed,
                       seed, sensitivity)) {
        return fmi3Error;
    }
    double *direction = no_direction(s), derivative[N_OUTPUTS];
    for (size_t i = 0; i < nKnowns; i++) {
        const Span span = fmi3_span(s->estimator, knowns[i]);
        for (size_t k = 0; k < span.count; k++) {
            direction[input_place(s->estimator, span.first + k)] += *seed++;
        }
    }
    estimator_derivative(s->estimator, direction, derivative);
    for (size_t i = 0; i < nUnknowns; i++) {
        const Span span = fmi3_span(s->estimator, unknowns[i]);
        memcpy(sensitivity, derivative + span.first, span.count * sizeof *sensitivity);
        sensitivity += span.count;
    }
    return fmi3OK;
}

/* Sum of the derivatives of the unknowns, weighted with the seed. Where that is 0, a derivative that is not a number
   does not matter. */
static double weighted(const Estimator *e, const fmi3ValueReference unknowns[], size_t nUnknowns, const double *seed,
                       const double *derivative) {
    double sum = 0.0;
    for (size_t i = 0; i < nUnknowns; i++) {
        const Span span = fmi3_span(e, unknowns[i]);
        for (size_t k = 0; k < span.count; k++, seed++) {
            sum += *seed != 0.0 ? *seed * derivative[span.first + k] : 0.0;
        }
    }
    return sum;
}

/* One directional derivative for each element of the knowns: a few microseconds each. */
fmi3Status fmi3GetAdjointDerivative(fmi3Instance instance, const fmi3ValueReference unknowns[], size_t nUnknowns,
                                    const fmi3ValueReference knowns[], size_t nKnowns, const fmi3Float64 seed[],
                                    size_t nSeed, fmi3Float64 sensitivity[], size_t nSensitivity) {
    Instance *s = instance;
    if (!arguments_fit(s, "fmi3GetAdjointDerivative", unknowns, nUnknowns, nSeed, knowns, nKnowns, nSensitivity, seed,
                       sensitivity)) {
        return fmi3Error;
    }
    for (size_t i = 0; i < nKnowns; i++) {
        const Span span = fmi3_span(s->estimator, knowns[i]);
        for (size_t k = 0; k < span.count; k++) {
            double *direction = no_direction(s), derivative[N_OUTPUTS];
            direction[input_place(s->estimator, span.first + k)] = 1.0;
            estimator_derivative(s->estimator, direction, derivative);
            *sensitivity++ = weighted(s->estimator, unknowns, nUnknowns, seed, derivative);
        }
    }
    return fmi3OK;
}
