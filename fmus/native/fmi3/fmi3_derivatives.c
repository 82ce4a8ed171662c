/* FMI 3.0: partial derivatives. */

#include "fmi3.h"

#include "../core/floating.h"

typedef size_t IndexOf(const Model *model, size_t variable);

/* Number of elements of the variables listed; SIZE_MAX if one has no index. */
static size_t elements(const Instance *s, const fmi3ValueReference references[], size_t count, IndexOf *index_of) {
    size_t total = 0;
    for (size_t i = 0; i < count; i++) {
        const Selection array = fmi3_array(s, references[i]);
        if (array.count == 0 || index_of(s->model, array.first) == SIZE_MAX) {
            return SIZE_MAX;
        }
        total += array.count;
    }
    return total;
}

/* Whether the arguments fit, nOfUnknowns and nOfKnowns being the numbers of elements that the caller gives. */
static int arguments_fit(Instance *s, const char *function, const fmi3ValueReference unknowns[], size_t nUnknowns,
                         size_t nOfUnknowns, const fmi3ValueReference knowns[], size_t nKnowns, size_t nOfKnowns,
                         const double seed[], const double sensitivity[]) {
    const Derivatives *derivatives = MODEL.derivatives;
    if (s == NULL || derivatives == NULL) {
        instance_not_offered(s, function);
        return 0;
    }
    if (!instance_allows(s, function, INITIALIZATION | FMI3_RUNNING) || !instance_given(s, function, unknowns)
        || !instance_given(s, function, knowns) || !instance_given(s, function, seed)
        || !instance_given(s, function, sensitivity)) {
        return 0;
    }
    if (elements(s, unknowns, nUnknowns, derivatives->output_index) != nOfUnknowns
        || elements(s, knowns, nKnowns, derivatives->input_index) != nOfKnowns) {
        instance_error(s, NO_DERIVATIVE "as many values as these have elements", function);
        return 0;
    }
    return 1;
}

static fmi3Status directional_derivative(Instance *s, const fmi3ValueReference unknowns[], size_t nUnknowns,
                                         const fmi3ValueReference knowns[], size_t nKnowns, const fmi3Float64 seed[],
                                         size_t nSeed, fmi3Float64 sensitivity[], size_t nSensitivity) {
    const Derivatives *derivatives = MODEL.derivatives;
    if (!arguments_fit(s, "fmi3GetDirectionalDerivative", unknowns, nUnknowns, nSensitivity, knowns, nKnowns, nSeed,
                       seed, sensitivity)) {
        return fmi3Error;
    }
    double *direction = derivatives->clear_direction(s->model);
    for (size_t i = 0; i < nKnowns; i++) {
        const Selection array = fmi3_array(s, knowns[i]);
        for (size_t k = 0; k < array.count; k++) {
            direction[derivatives->input_index(s->model, array.first + k)] += *seed++;
        }
    }
    char text[MODEL_TEXT_SIZE];
    const double *derivative = derivatives->along_direction(s->model, text);
    if (derivative == NULL) {
        return (fmi3Status)instance_discard(s, "fmi3GetDirectionalDerivative", text);
    }
    for (size_t i = 0; i < nUnknowns; i++) {
        const Selection array = fmi3_array(s, unknowns[i]);
        for (size_t k = 0; k < array.count; k++) {
            *sensitivity++ = derivative[derivatives->output_index(s->model, array.first + k)];
        }
    }
    return fmi3OK;
}

fmi3Status fmi3GetDirectionalDerivative(fmi3Instance instance, const fmi3ValueReference unknowns[], size_t nUnknowns,
                                        const fmi3ValueReference knowns[], size_t nKnowns, const fmi3Float64 seed[],
                                        size_t nSeed, fmi3Float64 sensitivity[], size_t nSensitivity) {
    const Floating host = floating_enter();
    const fmi3Status status =
        directional_derivative(instance, unknowns, nUnknowns, knowns, nKnowns, seed, nSeed, sensitivity, nSensitivity);
    floating_leave(&host);
    return status;
}

/* Sum of the derivatives of the unknowns, weighted with the seed. Where that is 0, a derivative that is not a number
   does not matter. */
static double weighted(const Instance *s, const fmi3ValueReference unknowns[], size_t nUnknowns, const double *seed,
                       const double *derivative) {
    double sum = 0.0;
    for (size_t i = 0; i < nUnknowns; i++) {
        const Selection array = fmi3_array(s, unknowns[i]);
        for (size_t k = 0; k < array.count; k++, seed++) {
            const size_t index = MODEL.derivatives->output_index(s->model, array.first + k);
            sum += *seed != 0.0 ? *seed * derivative[index] : 0.0;
        }
    }
    return sum;
}

/* One directional derivative for each element of the knowns. */
static fmi3Status adjoint_derivative(Instance *s, const fmi3ValueReference unknowns[], size_t nUnknowns,
                                     const fmi3ValueReference knowns[], size_t nKnowns, const fmi3Float64 seed[],
                                     size_t nSeed, fmi3Float64 sensitivity[], size_t nSensitivity) {
    const Derivatives *derivatives = MODEL.derivatives;
    if (!arguments_fit(s, "fmi3GetAdjointDerivative", unknowns, nUnknowns, nSeed, knowns, nKnowns, nSensitivity, seed,
                       sensitivity)) {
        return fmi3Error;
    }
    for (size_t i = 0; i < nKnowns; i++) {
        const Selection array = fmi3_array(s, knowns[i]);
        for (size_t k = 0; k < array.count; k++) {
            char text[MODEL_TEXT_SIZE];
            derivatives->clear_direction(s->model)[derivatives->input_index(s->model, array.first + k)] = 1.0;
            const double *derivative = derivatives->along_direction(s->model, text);
            if (derivative == NULL) {
                return (fmi3Status)instance_discard(s, "fmi3GetAdjointDerivative", text);
            }
            *sensitivity++ = weighted(s, unknowns, nUnknowns, seed, derivative);
        }
    }
    return fmi3OK;
}

fmi3Status fmi3GetAdjointDerivative(fmi3Instance instance, const fmi3ValueReference unknowns[], size_t nUnknowns,
                                    const fmi3ValueReference knowns[], size_t nKnowns, const fmi3Float64 seed[],
                                    size_t nSeed, fmi3Float64 sensitivity[], size_t nSensitivity) {
    const Floating host = floating_enter();
    const fmi3Status status =
        adjoint_derivative(instance, unknowns, nUnknowns, knowns, nKnowns, seed, nSeed, sensitivity, nSensitivity);
    floating_leave(&host);
    return status;
}
