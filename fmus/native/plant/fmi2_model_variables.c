/* The functions of FMI 2.0.5 that get and set variables. */

#include "fmi2_model.h"

/* Whether all variables are of a type; if not, a message says so. */
static int are(const Instance *s, const char *function, const fmi2ValueReference vr[], size_t n, Type type) {
    for (size_t i = 0; i < n; i++) {
        if (!model_has(s->model, vr[i], type)) {
            fmi2_tell(s, fmi2Error, "%s: value reference %u is no variable of that type", function, vr[i]);
            return 0;
        }
    }
    return 1;
}

static int readable(Instance *s, const char *function, const fmi2ValueReference vr[], size_t n, const void *value,
                    Type type) {
    if (!fmi2_allowed(s, function, READABLE, n, vr, value) || !are(s, function, vr, n, type)) {
        return 0;
    }
    model_update(s->model);
    return 1;
}

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Real value[]) {
    Instance *s = c;
    if (!readable(s, "fmi2GetReal", vr, n, value, REAL)) {
        return fmi2Error;
    }
    for (size_t i = 0; i < n; i++) {
        value[i] = s->model->value[vr[i]];
    }
    return fmi2OK;
}

/* Integers and Booleans are both int in C. */
static fmi2Status get_ints(Instance *s, const char *function, const fmi2ValueReference vr[], size_t n, int value[],
                           Type type) {
    if (!readable(s, function, vr, n, value, type)) {
        return fmi2Error;
    }
    for (size_t i = 0; i < n; i++) {
        value[i] = (int)s->model->value[vr[i]];
    }
    return fmi2OK;
}

fmi2Status fmi2GetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Integer value[]) {
    return get_ints(c, "fmi2GetInteger", vr, n, value, INTEGER);
}

fmi2Status fmi2GetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Boolean value[]) {
    return get_ints(c, "fmi2GetBoolean", vr, n, value, BOOLEAN);
}

static fmi2Status set(Instance *s, const char *function, fmi2ValueReference vr, double value) {
    char text[MODEL_TEXT_SIZE];
    if (model_set(s->model, vr, value, text) != STATUS_OK) {
        return fmi2_tell(s, fmi2Error, "%s: %s", function, text);
    }
    return fmi2OK;
}

static int writable(Instance *s, const char *function, const fmi2ValueReference vr[], size_t n, const void *value,
                    Type type) {
    return fmi2_allowed(s, function, SETTABLE, n, vr, value) && are(s, function, vr, n, type);
}

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Real value[]) {
    fmi2Status status = writable(c, "fmi2SetReal", vr, n, value, REAL) ? fmi2OK : fmi2Error;
    for (size_t i = 0; i < n && status == fmi2OK; i++) {
        status = set(c, "fmi2SetReal", vr[i], value[i]);
    }
    return status;
}

fmi2Status fmi2SetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Integer value[]) {
    fmi2Status status = writable(c, "fmi2SetInteger", vr, n, value, INTEGER) ? fmi2OK : fmi2Error;
    for (size_t i = 0; i < n && status == fmi2OK; i++) {
        status = set(c, "fmi2SetInteger", vr[i], value[i]);
    }
    return status;
}

fmi2Status fmi2SetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Boolean value[]) {
    fmi2Status status = writable(c, "fmi2SetBoolean", vr, n, value, BOOLEAN) ? fmi2OK : fmi2Error;
    for (size_t i = 0; i < n && status == fmi2OK; i++) {
        status = set(c, "fmi2SetBoolean", vr[i], value[i] != fmi2False);
    }
    return status;
}

/* There are no Strings: lists of them are empty. */
static fmi2Status no_strings(const Instance *s, const char *function, size_t n) {
    if (s == NULL) {
        return fmi2Error;
    }
    return n == 0 ? fmi2OK : fmi2_tell(s, fmi2Error, "%s: this FMU has no String variables", function);
}

fmi2Status fmi2GetString(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2String value[]) {
    (void)vr;
    (void)value;
    return no_strings(c, "fmi2GetString", n);
}

fmi2Status fmi2SetString(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2String value[]) {
    (void)vr;
    (void)value;
    return no_strings(c, "fmi2SetString", n);
}
