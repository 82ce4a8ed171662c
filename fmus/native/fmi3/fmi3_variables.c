/* FMI 3.0: reading and setting variables, and their partial derivatives. */

#include "fmi3.h"

#include <limits.h>

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

/* Elements of an array, from element k on, of which at most CHUNK are converted at once. */
static Selection chunk_of(const Selection *array, size_t k) {
    return (Selection){NULL, array->first + k, array->count - k < CHUNK ? array->count - k : CHUNK};
}

/* Whether an array is of a type. FMI 3.0 reads enumerations as Int64, and other integers as Int32. */
static int is_of(const Instance *s, const Selection *array, Type type) {
    return array->count > 0 && model_type_of(s->model, array->first) == type;
}

/* The values of a type of FMI 3.0 are variables of one type of the model, which reads and sets them as another: numbers as they
   are, others by the chunk. Time is no variable. */
#define GET(Name, variables, type)                                                                     \
    fmi3Status fmi3Get##Name(VARIABLES, fmi3##Name values[], size_t nValues) {                         \
        Instance *s = instance;                                                                        \
        char text[MODEL_TEXT_SIZE];                                                                    \
        if (!lists_fit(s, __func__, READABLE, valueReferences, nValueReferences, values, nValues)) {   \
            return fmi3Error;                                                                          \
        }                                                                                              \
        for (size_t i = 0; i < nValueReferences; i++) {                                                \
            const Selection array = fmi3_array(s, valueReferences[i]);                                 \
            const int is_time = type == REAL && array.count == 0;                                      \
            if (!is_time && (!is_of(s, &array, variables)                                              \
                             || (type == REAL && !model_get(s->model, type, &array, values, text)))) { \
                return fmi3_wrong_type(s, __func__, valueReferences[i]);                               \
            }                                                                                          \
            for (size_t k = 0; type != REAL && k < array.count; k += CHUNK) {                          \
                int chunk[CHUNK];                                                                      \
                const Selection which = chunk_of(&array, k);                                           \
                if (!model_get(s->model, type, &which, chunk, text)) {                                 \
                    return fmi3_wrong_type(s, __func__, valueReferences[i]);                           \
                }                                                                                      \
                for (size_t j = 0; j < which.count; j++) {                                             \
                    values[k + j] = (fmi3##Name)chunk[j];                                              \
                }                                                                                      \
            }                                                                                          \
            if (is_time) {                                                                             \
                *values = (fmi3##Name)s->model->time;                                                  \
            }                                                                                          \
            values += is_time ? 1 : array.count;                                                       \
        }                                                                                              \
        return fmi3OK;                                                                                 \
    }

#define SET(Name, variables, type)                                                                   \
    fmi3Status fmi3Set##Name(VARIABLES, const fmi3##Name values[], size_t nValues) {                 \
        Instance *s = instance;                                                                      \
        char text[MODEL_TEXT_SIZE];                                                                  \
        if (!lists_fit(s, __func__, SETTABLE, valueReferences, nValueReferences, values, nValues)) { \
            return fmi3Error;                                                                        \
        }                                                                                            \
        for (size_t i = 0; i < nValueReferences; i++) {                                              \
            const Selection array = fmi3_array(s, valueReferences[i]);                               \
            if (!is_of(s, &array, variables)) {                                                      \
                return fmi3_wrong_type(s, __func__, valueReferences[i]);                             \
            }                                                                                        \
            for (size_t k = 0; k < array.count; k += type == REAL ? array.count : CHUNK) {           \
                int chunk[CHUNK];                                                                    \
                const Selection which = type == REAL ? array : chunk_of(&array, k);                  \
                for (size_t j = 0; type != REAL && j < which.count; j++) {                           \
                    chunk[j] = as_int((fmi3Int64)values[k + j]);                                     \
                }                                                                                    \
                const void *given = type == REAL ? (const void *)values : chunk;                     \
                if (!model_set(s->model, type, &which, given, text)) {                               \
                    return refused(s, __func__, valueReferences[i], text);                           \
                }                                                                                    \
            }                                                                                        \
            values += array.count;                                                                   \
        }                                                                                            \
        return fmi3OK;                                                                               \
    }

/* The nearest int: no variable takes a number beyond. */
static int as_int(fmi3Int64 value) {
    return value > INT_MAX ? INT_MAX : value < INT_MIN ? INT_MIN : (int)value;
}

GET(Float64, REAL, REAL)
GET(Int32, INTEGER, INTEGER)
GET(Int64, ENUMERATION, INTEGER)
GET(Boolean, BOOLEAN, BOOLEAN)
SET(Float64, REAL, REAL)
SET(Int32, INTEGER, INTEGER)
SET(Int64, ENUMERATION, INTEGER)
SET(Boolean, BOOLEAN, BOOLEAN)

/* Partial derivatives. */

fmi3Status fmi3GetDirectionalDerivative(fmi3Instance instance, const fmi3ValueReference unknowns[], size_t nUnknowns,
                                        const fmi3ValueReference knowns[], size_t nKnowns, const fmi3Float64 seed[],
                                        size_t nSeed, fmi3Float64 sensitivity[], size_t nSensitivity) {
    const References of = {unknowns, nUnknowns, nSensitivity, fmi3_array}, by = {knowns, nKnowns, nSeed, fmi3_array};
    return (fmi3Status)instance_derivative(instance, __func__, &of, &by, seed, sensitivity, 0);
}

fmi3Status fmi3GetAdjointDerivative(fmi3Instance instance, const fmi3ValueReference unknowns[], size_t nUnknowns,
                                    const fmi3ValueReference knowns[], size_t nKnowns, const fmi3Float64 seed[],
                                    size_t nSeed, fmi3Float64 sensitivity[], size_t nSensitivity) {
    const References of = {unknowns, nUnknowns, nSeed, fmi3_array}, by = {knowns, nKnowns, nSensitivity, fmi3_array};
    return (fmi3Status)instance_derivative(instance, __func__, &of, &by, seed, sensitivity, 1);
}
