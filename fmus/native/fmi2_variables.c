/* Variables of FMI 2.0: getting, setting and derivatives. */

#include <string.h>

#include "fmi2_common.h"
#include "variables.h"

int fmi2_given(const Instance *instance, const char *function, const void *argument) {
    if (argument == NULL) {
        instance_error(instance, "%s: an argument is NULL", function);
    }
    return argument != NULL;
}

/* Lists of nvr value references and values, in one of the modes. */
static int lists_given(Instance *instance, const char *function, int modes, const void *vr, size_t nvr,
                       const void *value) {
    return instance_allows(instance, function, modes)
        && (nvr == 0 || (fmi2_given(instance, function, vr) && fmi2_given(instance, function, value)));
}

static fmi2Status wrong_type(const Instance *s, const char *function) {
    return (fmi2Status)instance_error(s, "%s: a value reference is no variable of that type", function);
}

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2Real value[]) {
    Instance *s = c;
    if (!lists_given(s, "fmi2GetReal", FMI2_READABLE, vr, nvr, value)) {
        return fmi2Error;
    }
    return get_listed_reals(s->estimator, vr, nvr, value) ? fmi2OK : wrong_type(s, "fmi2GetReal");
}

fmi2Status fmi2GetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2Integer value[]) {
    Instance *s = c;
    if (!lists_given(s, "fmi2GetInteger", FMI2_READABLE, vr, nvr, value)) {
        return fmi2Error;
    }
    for (size_t i = 0; i < nvr; i++) {
        if (!get_integer(s->estimator, vr[i], value + i)) {
            return wrong_type(s, "fmi2GetInteger");
        }
    }
    return fmi2OK;
}

fmi2Status fmi2GetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2Boolean value[]) {
    Instance *s = c;
    if (!lists_given(s, "fmi2GetBoolean", FMI2_READABLE, vr, nvr, value)) {
        return fmi2Error;
    }
    for (size_t i = 0; i < nvr; i++) {
        if (!get_boolean(s->estimator, vr[i], value + i)) {
            return wrong_type(s, "fmi2GetBoolean");
        }
    }
    return fmi2OK;
}

fmi2Status fmi2GetString(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2String value[]) {
    Instance *s = c;
    if (!lists_given(s, "fmi2GetString", FMI2_READABLE, vr, nvr, value)) {
        return fmi2Error;
    }
    return nvr == 0 ? fmi2OK : wrong_type(s, "fmi2GetString");
}

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2Real value[]) {
    Instance *s = c;
    char text[MAP_TEXT_SIZE];
    if (!lists_given(s, "fmi2SetReal", FMI2_SETTABLE, vr, nvr, value)) {
        return fmi2Error;
    }
    if (!set_listed_reals(s->estimator, vr, nvr, value, text)) {
        return (fmi2Status)instance_error(s, "fmi2SetReal: %s", text);
    }
    return fmi2OK;
}

fmi2Status fmi2SetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2Integer value[]) {
    Instance *s = c;
    if (!lists_given(s, "fmi2SetInteger", FMI2_SETTABLE, vr, nvr, value)) {
        return fmi2Error;
    }
    return nvr == 0 ? fmi2OK : wrong_type(s, "fmi2SetInteger");
}

fmi2Status fmi2SetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2Boolean value[]) {
    Instance *s = c;
    char text[MAP_TEXT_SIZE];
    if (!lists_given(s, "fmi2SetBoolean", FMI2_SETTABLE, vr, nvr, value)) {
        return fmi2Error;
    }
    for (size_t i = 0; i < nvr; i++) {
        if (!set_boolean(s->estimator, vr[i], value[i], text)) {
            return (fmi2Status)instance_error(s, "fmi2SetBoolean: %s", text);
        }
    }
    return fmi2OK;
}

fmi2Status fmi2SetString(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2String value[]) {
    Instance *s = c;
    if (!lists_given(s, "fmi2SetString", FMI2_SETTABLE, vr, nvr, value)) {
        return fmi2Error;
    }
    return nvr == 0 ? fmi2OK : wrong_type(s, "fmi2SetString");
}

fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference vUnknown_ref[], size_t nUnknown,
                                        const fmi2ValueReference vKnown_ref[], size_t nKnown, const fmi2Real dvKnown[],
                                        fmi2Real dvUnknown[]) {
    static const char NAME[] = "fmi2GetDirectionalDerivative";
    Instance *s = c;
    if (!lists_given(s, NAME, INITIALIZATION | FMI2_RUNNING, vUnknown_ref, nUnknown, dvUnknown)
        || !lists_given(s, NAME, INITIALIZATION | FMI2_RUNNING, vKnown_ref, nKnown, dvKnown)) {
        return fmi2Error;
    }
    memset(s->direction, 0, (s->estimator->map.n_gauges + N_SCALAR_INPUTS) * sizeof *s->direction);
    for (size_t i = 0; i < nKnown; i++) {
        const size_t place = input_place(s->estimator, vKnown_ref[i]);
        if (place == SIZE_MAX) {
            return wrong_type(s, NAME);
        }
        s->direction[place] += dvKnown[i];
    }
    double derivative[N_OUTPUTS];
    estimator_derivative(s->estimator, s->direction, derivative);
    for (size_t i = 0; i < nUnknown; i++) {
        if (!is_real_output(vUnknown_ref[i])) {
            return wrong_type(s, NAME);
        }
        dvUnknown[i] = derivative[vUnknown_ref[i]];
    }
    return fmi2OK;
}
