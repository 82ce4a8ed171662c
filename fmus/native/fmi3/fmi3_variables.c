/* FMI 3.0: reading and setting variables, and their partial derivatives. */

#include "fmi3.h"

#include <limits.h>

#include "../core/floating.h"

#define CHUNK 64 /* integers or Booleans that are converted at once */

fmi3Status fmi3_wrong_type(const Instance *instance, const char *function, fmi3ValueReference reference) {
    return (fmi3Status)instance_error(instance, "%s: " WRONG_TYPE, function, (unsigned long)reference);
}

/* Whether the lists are there, and nValues is the number of values that the variables have; if not, or if the instance
   is in none of the modes, a message reports it. */
static int lists_fit(Instance *instance, const char *function, int modes, const fmi3ValueReference references[],
                     size_t nReferences, const void *values, size_t nValues) {
    if (!instance_allows(instance, function, modes)
        || (nReferences > 0 && !instance_given(instance, function, references))
        || (nValues > 0 && !instance_given(instance, function, values))) {
        return 0;
    }
    size_t required = 0;
    for (size_t i = 0; i < nReferences; i++) {
        const size_t count = fmi3_array(instance, references[i]).count;
        if (count == 0 && references[i] != instance->model->time_reference) {
            fmi3_wrong_type(instance, function, references[i]);
            return 0;
        }
        required += count > 0 ? count : 1;
    }
    if (required != nValues) {
        instance_error(instance, "%s: %lu values found, the variables have %lu", function, (unsigned long)nValues,
                       (unsigned long)required);
    }
    return required == nValues;
}

static fmi3Status refused(const Instance *s, const char *function, fmi3ValueReference reference, const char *text) {
    return (fmi3Status)instance_error(s, "%s: value reference %lu: %s", function, (unsigned long)reference, text);
}

fmi3Status fmi3GetFloat64(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                          fmi3Float64 values[], size_t nValues) {
    static const char NAME[] = "fmi3GetFloat64";
    Instance *s = instance;
    char text[MODEL_TEXT_SIZE];
    if (!lists_fit(s, NAME, FMI3_READABLE, valueReferences, nValueReferences, values, nValues)) {
        return fmi3Error;
    }
    for (size_t i = 0; i < nValueReferences; i++) {
        const Selection which = fmi3_array(s, valueReferences[i]);
        if (which.count == 0) {
            *values++ = s->model->time;
        } else if (!model_get_reals(s->model, &which, values, text)) {
            return fmi3_wrong_type(s, NAME, valueReferences[i]);
        }
        values += which.count;
    }
    return fmi3OK;
}

fmi3Status fmi3SetFloat64(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                          const fmi3Float64 values[], size_t nValues) {
    static const char NAME[] = "fmi3SetFloat64";
    Instance *s = instance;
    char text[MODEL_TEXT_SIZE];
    if (!lists_fit(s, NAME, FMI3_SETTABLE, valueReferences, nValueReferences, values, nValues)) {
        return fmi3Error;
    }
    for (size_t i = 0; i < nValueReferences; i++) {
        const Selection which = fmi3_array(s, valueReferences[i]);
        if (which.count == 0) {
            return (fmi3Status)instance_error(s, "%s: time cannot be set", NAME);
        }
        if (!model_set_reals(s->model, &which, values, text)) {
            return refused(s, NAME, valueReferences[i], text);
        }
        values += which.count;
    }
    return fmi3OK;
}

/* Elements of an array, from element k on, of which at most CHUNK are converted at once. */
static Selection chunk_of(const Selection *array, size_t k) {
    return (Selection){NULL, array->first + k, array->count - k < CHUNK ? array->count - k : CHUNK};
}

/* Whether an array is of a type. FMI 3.0 reads enumerations as Int64, and other integers as Int32. */
static int is_of(const Instance *s, const Selection *array, Type type) {
    return array->count > 0 && model_type_of(s->model, array->first) == type;
}

/* The nearest int: no variable takes a number beyond. */
static int as_int(fmi3Int64 value) {
    return value > INT_MAX ? INT_MAX : value < INT_MIN ? INT_MIN : (int)value;
}

#define GET(Name, variables, get)                                                                     \
    fmi3Status fmi3Get##Name(fmi3Instance instance, const fmi3ValueReference valueReferences[],       \
                             size_t nValueReferences, fmi3##Name values[], size_t nValues) {          \
        static const char NAME[] = "fmi3Get" #Name;                                                   \
        Instance *s = instance;                                                                       \
        char text[MODEL_TEXT_SIZE];                                                                   \
        if (!lists_fit(s, NAME, FMI3_READABLE, valueReferences, nValueReferences, values, nValues)) { \
            return fmi3Error;                                                                         \
        }                                                                                             \
        for (size_t i = 0; i < nValueReferences; i++) {                                               \
            const Selection array = fmi3_array(s, valueReferences[i]);                                \
            if (!is_of(s, &array, variables)) {                                                       \
                return fmi3_wrong_type(s, NAME, valueReferences[i]);                                  \
            }                                                                                         \
            for (size_t k = 0; k < array.count; k += CHUNK) {                                         \
                int chunk[CHUNK];                                                                     \
                const Selection which = chunk_of(&array, k);                                          \
                if (!get(s->model, &which, chunk, text)) {                                            \
                    return fmi3_wrong_type(s, NAME, valueReferences[i]);                              \
                }                                                                                     \
                for (size_t j = 0; j < which.count; j++) {                                            \
                    *values++ = (fmi3##Name)chunk[j];                                                 \
                }                                                                                     \
            }                                                                                         \
        }                                                                                             \
        return fmi3OK;                                                                                \
    }

#define SET(Name, variables, set)                                                                     \
    fmi3Status fmi3Set##Name(fmi3Instance instance, const fmi3ValueReference valueReferences[],       \
                             size_t nValueReferences, const fmi3##Name values[], size_t nValues) {    \
        static const char NAME[] = "fmi3Set" #Name;                                                   \
        Instance *s = instance;                                                                       \
        char text[MODEL_TEXT_SIZE];                                                                   \
        if (!lists_fit(s, NAME, FMI3_SETTABLE, valueReferences, nValueReferences, values, nValues)) { \
            return fmi3Error;                                                                         \
        }                                                                                             \
        for (size_t i = 0; i < nValueReferences; i++) {                                               \
            const Selection array = fmi3_array(s, valueReferences[i]);                                \
            if (!is_of(s, &array, variables)) {                                                       \
                return fmi3_wrong_type(s, NAME, valueReferences[i]);                                  \
            }                                                                                         \
            for (size_t k = 0; k < array.count; k += CHUNK) {                                         \
                int chunk[CHUNK];                                                                     \
                const Selection which = chunk_of(&array, k);                                          \
                for (size_t j = 0; j < which.count; j++) {                                            \
                    chunk[j] = as_int((fmi3Int64)*values++);                                          \
                }                                                                                     \
                if (!set(s->model, &which, chunk, text)) {                                            \
                    return refused(s, NAME, valueReferences[i], text);                                \
                }                                                                                     \
            }                                                                                         \
        }                                                                                             \
        return fmi3OK;                                                                                \
    }

GET(Int32, INTEGER, model_get_integers)
GET(Int64, ENUMERATION, model_get_integers)
GET(Boolean, BOOLEAN, model_get_booleans)
SET(Int32, INTEGER, model_set_integers)
SET(Int64, ENUMERATION, model_set_integers)
SET(Boolean, BOOLEAN, model_set_booleans)

/* Partial derivatives. */

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
