/* FMI 2.0.5: reading and setting variables. A value reference is the number of a variable. */

#include "fmi2.h"

#include "../core/floating.h"

/* The variables of a list; a run if they follow each other without a gap. */
static Selection selection_of(const fmi2ValueReference vr[], size_t nvr) {
    unsigned gaps = 0;
    for (size_t k = 0; k < nvr; k++) {
        gaps |= vr[k] ^ (vr[0] + (unsigned)k);
    }
    return nvr > 0 && gaps == 0 ? (Selection){NULL, vr[0], nvr} : (Selection){vr, 0, nvr};
}

/* Whether the lists of nvr value references and values are there, in one of the modes. */
static int lists_given(Instance *instance, const char *function, int modes, const void *vr, size_t nvr,
                       const void *value) {
    return instance_allows(instance, function, modes)
        && (nvr == 0 || (instance_given(instance, function, vr) && instance_given(instance, function, value)));
}

/* fmi2GetReal, fmi2SetReal and the like. Integers and Booleans are both int in C. */
#define GET(Type, get)                                                                                         \
    fmi2Status fmi2Get##Type(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2##Type value[]) { \
        Instance *s = c;                                                                                       \
        char text[MODEL_TEXT_SIZE];                                                                            \
        if (!lists_given(s, "fmi2Get" #Type, FMI2_READABLE, vr, nvr, value)) {                                 \
            return fmi2Error;                                                                                  \
        }                                                                                                      \
        const Selection which = selection_of(vr, nvr);                                                         \
        return get(s->model, &which, value, text)                                                              \
                 ? fmi2OK                                                                                      \
                 : (fmi2Status)instance_error(s, "fmi2Get" #Type ": %s", text);                                \
    }

#define SET(Type, set)                                                                                               \
    fmi2Status fmi2Set##Type(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2##Type value[]) { \
        Instance *s = c;                                                                                             \
        char text[MODEL_TEXT_SIZE];                                                                                  \
        if (!lists_given(s, "fmi2Set" #Type, FMI2_SETTABLE, vr, nvr, value)) {                                       \
            return fmi2Error;                                                                                        \
        }                                                                                                            \
        const Selection which = selection_of(vr, nvr);                                                               \
        return set(s->model, &which, value, text)                                                                    \
                 ? fmi2OK                                                                                            \
                 : (fmi2Status)instance_error(s, "fmi2Set" #Type ": %s", text);                                      \
    }

GET(Real, model_get_reals)
GET(Integer, model_get_integers)
GET(Boolean, model_get_booleans)
SET(Real, model_set_reals)
SET(Integer, model_set_integers)
SET(Boolean, model_set_booleans)

/* There are no Strings: lists of them are empty. */
static fmi2Status no_strings(Instance *s, const char *function, int modes, const fmi2ValueReference vr[], size_t nvr,
                             const void *value) {
    if (!lists_given(s, function, modes, vr, nvr, value)) {
        return fmi2Error;
    }
    return nvr == 0 ? fmi2OK : (fmi2Status)instance_error(s, "%s: " WRONG_TYPE, function, (unsigned long)vr[0]);
}

fmi2Status fmi2GetString(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2String value[]) {
    return no_strings(c, "fmi2GetString", FMI2_READABLE, vr, nvr, value);
}

fmi2Status fmi2SetString(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2String value[]) {
    return no_strings(c, "fmi2SetString", FMI2_SETTABLE, vr, nvr, value);
}

static fmi2Status no_derivative(const Instance *s, const char *function, fmi2ValueReference reference) {
    return (fmi2Status)instance_error(s, NO_DERIVATIVE "value reference %lu found", function, (unsigned long)reference);
}

static fmi2Status directional_derivative(Instance *s, const fmi2ValueReference vUnknown_ref[], size_t nUnknown,
                                         const fmi2ValueReference vKnown_ref[], size_t nKnown, const fmi2Real dvKnown[],
                                         fmi2Real dvUnknown[]) {
    static const char NAME[] = "fmi2GetDirectionalDerivative";
    const int modes = INITIALIZATION | FMI2_RUNNING;
    const Derivatives *derivatives = MODEL.derivatives;
    if (s == NULL || derivatives == NULL) {
        return (fmi2Status)instance_not_offered(s, NAME);
    }
    if (!lists_given(s, NAME, modes, vUnknown_ref, nUnknown, dvUnknown)
        || !lists_given(s, NAME, modes, vKnown_ref, nKnown, dvKnown)) {
        return fmi2Error;
    }
    double *direction = derivatives->clear_direction(s->model);
    for (size_t i = 0; i < nKnown; i++) {
        const size_t index = derivatives->input_index(s->model, vKnown_ref[i]);
        if (index == SIZE_MAX) {
            return no_derivative(s, NAME, vKnown_ref[i]);
        }
        direction[index] += dvKnown[i];
    }
    char text[MODEL_TEXT_SIZE];
    const double *derivative = derivatives->along_direction(s->model, text);
    if (derivative == NULL) {
        return (fmi2Status)instance_discard(s, NAME, text);
    }
    for (size_t i = 0; i < nUnknown; i++) {
        const size_t index = derivatives->output_index(s->model, vUnknown_ref[i]);
        if (index == SIZE_MAX) {
            return no_derivative(s, NAME, vUnknown_ref[i]);
        }
        dvUnknown[i] = derivative[index];
    }
    return fmi2OK;
}

fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference vUnknown_ref[], size_t nUnknown,
                                        const fmi2ValueReference vKnown_ref[], size_t nKnown, const fmi2Real dvKnown[],
                                        fmi2Real dvUnknown[]) {
    const Floating host = floating_enter();
    const fmi2Status status =
        directional_derivative(c, vUnknown_ref, nUnknown, vKnown_ref, nKnown, dvKnown, dvUnknown);
    floating_leave(&host);
    return status;
}
