/* The functions of FMI 2.0.5 for co-simulation, over any model. */

#include "fmi2Functions.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "map_resource.h"
#include "model.h"
#include "uri_path.h"

#define BEFORE_STEPS (INSTANTIATED | INITIALIZATION)
#define SETTABLE (BEFORE_STEPS | STEP)
#define READABLE (SETTABLE | TERMINATED)
#define PATH_SIZE 4096
#define SHOWN_PATH 1000 /* characters of a path that a message shows */
#define LINE_SIZE 1400
#define STATE_MARK 0x53464D56u

typedef struct {
    Model *model;
    char *name;
    fmi2CallbackLogger logger;
    fmi2ComponentEnvironment environment;
} Instance;

/* Some importers hand the state itself, not its address, to fmi2FreeFMUstate: what that then takes for the state is
   the first word, and freeing NULL does no harm. The serialised state follows. */
typedef struct {
    void *always_null;
    uint64_t mark;
} StateHead;

static fmi2Status tell(const Instance *s, fmi2Status status, const char *format, ...) {
    char text[LINE_SIZE];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    if (s->logger != NULL) {
        s->logger(s->environment, s->name, status, status == fmi2Discard ? "logStatusDiscard" : "logStatusError",
                  "%s", text);
    }
    return status;
}

/* Whether there is an instance, in one of the modes, and `length` elements at each of two arrays. */
static int allowed(const Instance *s, const char *function, int modes, size_t length, const void *a, const void *b) {
    if (s == NULL) {
        return 0;
    }
    if (((int)s->model->mode & modes) == 0) {
        tell(s, fmi2Error, "%s is not allowed in this state of the instance", function);
        return 0;
    }
    if (length > 0 && (a == NULL || b == NULL)) {
        tell(s, fmi2Error, "%s: an argument is NULL", function);
        return 0;
    }
    return 1;
}

const char *fmi2GetTypesPlatform(void) {
    return fmi2TypesPlatform;
}

const char *fmi2GetVersion(void) {
    return fmi2Version;
}

fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n, const fmi2String categories[]) {
    (void)on; /* errors are always told, and there is nothing else to tell */
    return allowed(c, "fmi2SetDebugLogging", READABLE, n, categories, categories) ? fmi2OK : fmi2Error;
}

/* The model of the file model.bin in a folder; NULL after a message. */
static Model *model_of(const Instance *wanted, const char *guid, const char *location) {
    char path[PATH_SIZE], text[MODEL_TEXT_SIZE];
    if (guid == NULL || location == NULL) {
        tell(wanted, fmi2Error, "%s is missing", guid == NULL ? "the guid" : "the resource location");
        return NULL;
    }
    if (!resource_path(location, "model.bin", path, sizeof path)) {
        tell(wanted, fmi2Error, "resource location '%.*s' is no file URI or path", SHOWN_PATH, location);
        return NULL;
    }
    size_t length;
    unsigned char *bytes = map_read(path, &length, text);
    Model *model = bytes != NULL ? model_create(bytes, length, text) : NULL;
    if (model == NULL) {
        tell(wanted, fmi2Error, "%.*s %s", SHOWN_PATH, path, text);
        return NULL;
    }
    if (strcmp(model->guid, guid) != 0) {
        tell(wanted, fmi2Error, "guid '%.80s' found, but the model in this FMU is '%s'", guid, model->guid);
        model_free(model);
        return NULL;
    }
    return model;
}

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String location,
                              const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean logging) {
    (void)visible;
    (void)logging;
    if (functions == NULL) {
        return NULL;
    }
    char unnamed[] = "";
    Instance wanted = {NULL, unnamed, functions->logger, functions->componentEnvironment};
    if (name == NULL || name[0] == '\0' || type != fmi2CoSimulation) {
        tell(&wanted, fmi2Error, "fmi2Instantiate: %s",
             type != fmi2CoSimulation ? "this FMU is for co-simulation" : "the instance name is missing");
        return NULL;
    }
    wanted.model = model_of(&wanted, guid, location);
    if (wanted.model == NULL) {
        return NULL;
    }
    Instance *instance = malloc(sizeof *instance);
    char *own_name = malloc(strlen(name) + 1);
    if (instance == NULL || own_name == NULL) {
        tell(&wanted, fmi2Error, "fmi2Instantiate: needs more memory than there is");
        free(instance);
        free(own_name);
        model_free(wanted.model);
        return NULL;
    }
    *instance = wanted;
    instance->name = strcpy(own_name, name);
    return instance;
}

void fmi2FreeInstance(fmi2Component c) {
    Instance *s = c;
    if (s != NULL) {
        model_free(s->model);
        free(s->name);
        free(s);
    }
}

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean with_tolerance, fmi2Real tolerance, fmi2Real start,
                               fmi2Boolean with_stop, fmi2Real stop) {
    Instance *s = c;
    (void)with_tolerance;
    (void)tolerance;
    if (!allowed(s, "fmi2SetupExperiment", INSTANTIATED, 0, NULL, NULL)) {
        return fmi2Error;
    }
    if (!isfinite(start) || (with_stop && !(stop >= start))) {
        return tell(s, fmi2Error, "fmi2SetupExperiment: from %g to %g s is no time span", start, stop);
    }
    s->model->time = start;
    s->model->outdated = 1;
    return fmi2OK;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c) {
    Instance *s = c;
    if (!allowed(s, "fmi2EnterInitializationMode", INSTANTIATED, 0, NULL, NULL)) {
        return fmi2Error;
    }
    s->model->mode = INITIALIZATION;
    return fmi2OK;
}

fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
    Instance *s = c;
    if (!allowed(s, "fmi2ExitInitializationMode", INITIALIZATION, 0, NULL, NULL)) {
        return fmi2Error;
    }
    s->model->outdated = 1;
    model_update(s->model);
    s->model->mode = STEP;
    return fmi2OK;
}

fmi2Status fmi2Terminate(fmi2Component c) {
    Instance *s = c;
    if (!allowed(s, "fmi2Terminate", STEP, 0, NULL, NULL)) {
        return fmi2Error;
    }
    s->model->mode = TERMINATED;
    return fmi2OK;
}

fmi2Status fmi2Reset(fmi2Component c) {
    Instance *s = c;
    if (s == NULL) {
        return fmi2Error;
    }
    model_reset(s->model);
    return fmi2OK;
}

/* Whether all variables are of a type; if not, a message says so. */
static int are(const Instance *s, const char *function, const fmi2ValueReference vr[], size_t n, Type type) {
    for (size_t i = 0; i < n; i++) {
        if (!model_has(s->model, vr[i], type)) {
            tell(s, fmi2Error, "%s: value reference %u is no variable of that type", function, vr[i]);
            return 0;
        }
    }
    return 1;
}

static int readable(Instance *s, const char *function, const fmi2ValueReference vr[], size_t n, const void *value,
                    Type type) {
    if (!allowed(s, function, READABLE, n, vr, value) || !are(s, function, vr, n, type)) {
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
        return tell(s, fmi2Error, "%s: %s", function, text);
    }
    return fmi2OK;
}

static int writable(Instance *s, const char *function, const fmi2ValueReference vr[], size_t n, const void *value,
                    Type type) {
    return allowed(s, function, SETTABLE, n, vr, value) && are(s, function, vr, n, type);
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
    return n == 0 ? fmi2OK : tell(s, fmi2Error, "%s: this FMU has no String variables", function);
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

/* The serialised state within an FMU state; NULL, after a message, if it is none. */
static unsigned char *serialised(const Instance *s, fmi2FMUstate state) {
    StateHead *head = state;
    if (head == NULL || head->mark != STATE_MARK) {
        tell(s, fmi2Error, "the FMU state is none of this FMU");
        return NULL;
    }
    return (unsigned char *)(head + 1);
}

/* The serialised state within *state, which is made if it is NULL; NULL after a message. */
static unsigned char *place_of(const Instance *s, fmi2FMUstate *state) {
    if (*state == NULL) {
        StateHead *head = calloc(1, sizeof *head + model_state_size(s->model));
        if (head == NULL) {
            tell(s, fmi2Error, "the FMU state needs more memory than there is");
            return NULL;
        }
        head->mark = STATE_MARK;
        *state = head;
    }
    return serialised(s, *state);
}

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *state) {
    Instance *s = c;
    unsigned char *bytes = allowed(s, "fmi2GetFMUstate", READABLE, 1, state, state) ? place_of(s, state) : NULL;
    if (bytes == NULL) {
        return fmi2Error;
    }
    model_write_state(s->model, bytes);
    return fmi2OK;
}

static fmi2Status check_state(Instance *s, const unsigned char *bytes, size_t size) {
    char text[MODEL_TEXT_SIZE];
    if (model_check_state(s->model, bytes, size, text) != STATUS_OK) {
        return tell(s, fmi2Error, "the FMU state %s", text);
    }
    return fmi2OK;
}

fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state) {
    Instance *s = c;
    const unsigned char *bytes = s != NULL ? serialised(s, state) : NULL;
    if (bytes == NULL || check_state(s, bytes, model_state_size(s->model)) != fmi2OK) {
        return fmi2Error;
    }
    model_read_state(s->model, bytes);
    return fmi2OK;
}

fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *state) {
    if (c == NULL) {
        return fmi2Error;
    }
    if (state != NULL) {
        free(*state);
        *state = NULL;
    }
    return fmi2OK;
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate state, size_t *size) {
    Instance *s = c;
    if (!allowed(s, "fmi2SerializedFMUstateSize", READABLE, 1, state, size)) {
        return fmi2Error;
    }
    *size = model_state_size(s->model);
    return fmi2OK;
}

fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate state, fmi2Byte bytes[], size_t size) {
    Instance *s = c;
    if (!allowed(s, "fmi2SerializeFMUstate", READABLE, 1, state, bytes) || serialised(s, state) == NULL) {
        return fmi2Error;
    }
    if (size < model_state_size(s->model)) {
        return tell(s, fmi2Error, "a serialised state takes %lu bytes, %lu found",
                    (unsigned long)model_state_size(s->model), (unsigned long)size);
    }
    memcpy(bytes, serialised(s, state), model_state_size(s->model));
    return fmi2OK;
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state) {
    Instance *s = c;
    if (!allowed(s, "fmi2DeSerializeFMUstate", READABLE, 1, bytes, state)
        || check_state(s, (const unsigned char *)bytes, size) != fmi2OK) {
        return fmi2Error;
    }
    unsigned char *content = place_of(s, state);
    if (content == NULL) {
        return fmi2Error;
    }
    memcpy(content, bytes, size);
    return fmi2OK;
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real from, fmi2Real size, fmi2Boolean keep_no_state) {
    Instance *s = c;
    char text[MODEL_TEXT_SIZE];
    (void)keep_no_state;
    if (!allowed(s, "fmi2DoStep", STEP, 0, NULL, NULL)) {
        return fmi2Error;
    }
    if (!(size > 0.0) || !isfinite(from + size)) {
        return tell(s, fmi2Error, "fmi2DoStep: a step of %g s from %g s found, must be positive", size, from);
    }
    model_update(s->model);
    s->model->time = from;
    const int status = s->model->behaviour->step(s->model, from + size, text);
    s->model->outdated = 1;
    return status == STATUS_OK ? fmi2OK : tell(s, (fmi2Status)status, "%s", text);
}

/* What the model description does not offer. */
static fmi2Status not_offered(const Instance *s, const char *function) {
    return s == NULL ? fmi2Error : tell(s, fmi2Error, "%s is not supported by this FMU", function);
}

fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference unknown[], size_t n_unknown,
                                        const fmi2ValueReference known[], size_t n_known, const fmi2Real dv_known[],
                                        fmi2Real dv_unknown[]) {
    (void)unknown;
    (void)n_unknown;
    (void)known;
    (void)n_known;
    (void)dv_known;
    (void)dv_unknown;
    return not_offered(c, "fmi2GetDirectionalDerivative");
}

fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t n,
                                       const fmi2Integer order[], const fmi2Real value[]) {
    (void)vr;
    (void)order;
    (void)value;
    return n == 0 && c != NULL ? fmi2OK : not_offered(c, "fmi2SetRealInputDerivatives");
}

fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t n,
                                        const fmi2Integer order[], fmi2Real value[]) {
    (void)vr;
    (void)order;
    (void)value;
    return n == 0 && c != NULL ? fmi2OK : not_offered(c, "fmi2GetRealOutputDerivatives");
}

fmi2Status fmi2CancelStep(fmi2Component c) {
    return not_offered(c, "fmi2CancelStep");
}

/* No step is ever pending, so the status of steps is known only by fmi2DoStep itself. */
fmi2Status fmi2GetStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Status *value) {
    (void)kind;
    (void)value;
    return c == NULL ? fmi2Error : fmi2Discard;
}

fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Real *value) {
    const Instance *s = c;
    if (s == NULL || value == NULL) {
        return fmi2Error;
    }
    if (kind != fmi2LastSuccessfulTime) {
        return fmi2Discard;
    }
    *value = s->model->time;
    return fmi2OK;
}

fmi2Status fmi2GetIntegerStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Integer *value) {
    (void)kind;
    (void)value;
    return c == NULL ? fmi2Error : fmi2Discard;
}

fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Boolean *value) {
    if (c == NULL || value == NULL) {
        return fmi2Error;
    }
    *value = fmi2False;
    return kind == fmi2Terminated ? fmi2OK : fmi2Discard;
}

fmi2Status fmi2GetStringStatus(fmi2Component c, const fmi2StatusKind kind, fmi2String *value) {
    (void)kind;
    (void)value;
    return c == NULL ? fmi2Error : fmi2Discard;
}
