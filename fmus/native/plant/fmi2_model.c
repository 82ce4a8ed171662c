/* The functions of FMI 2.0.5 for instances, modes and steps of co-simulation, over any model. */

#include "fmi2_model.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "map_resource.h"
#include "uri_path.h"

#define PATH_SIZE 4096
#define SHOWN_PATH 1000 /* characters of a path that a message shows */
#define LINE_SIZE 1400

fmi2Status fmi2_tell(const Instance *s, fmi2Status status, const char *format, ...) {
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

int fmi2_allowed(const Instance *s, const char *function, int modes, size_t length, const void *a, const void *b) {
    if (s == NULL) {
        return 0;
    }
    if (((int)s->model->mode & modes) == 0) {
        fmi2_tell(s, fmi2Error, "%s is not allowed in this state of the instance", function);
        return 0;
    }
    if (length > 0 && (a == NULL || b == NULL)) {
        fmi2_tell(s, fmi2Error, "%s: an argument is NULL", function);
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
    return fmi2_allowed(c, "fmi2SetDebugLogging", READABLE, n, categories, categories) ? fmi2OK : fmi2Error;
}

/* The model of the file model.bin in a folder; NULL after a message. */
static Model *model_of(const Instance *wanted, const char *guid, const char *location) {
    char path[PATH_SIZE], text[MODEL_TEXT_SIZE];
    if (guid == NULL || location == NULL) {
        fmi2_tell(wanted, fmi2Error, "%s is missing", guid == NULL ? "the guid" : "the resource location");
        return NULL;
    }
    if (!resource_path(location, "model.bin", path, sizeof path)) {
        fmi2_tell(wanted, fmi2Error, "resource location '%.*s' is no file URI or path", SHOWN_PATH, location);
        return NULL;
    }
    size_t length;
    unsigned char *bytes = map_read(path, &length, text);
    Model *model = bytes != NULL ? model_create(bytes, length, text) : NULL;
    if (model == NULL) {
        fmi2_tell(wanted, fmi2Error, "%.*s %s", SHOWN_PATH, path, text);
        return NULL;
    }
    if (strcmp(model->guid, guid) != 0) {
        fmi2_tell(wanted, fmi2Error, "guid '%.80s' found, but the model in this FMU is '%s'", guid, model->guid);
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
    Instance wanted = {NULL, unnamed, functions->logger, functions->componentEnvironment, 0, 0.0};
    if (name == NULL || name[0] == '\0' || type != fmi2CoSimulation) {
        fmi2_tell(&wanted, fmi2Error, "fmi2Instantiate: %s",
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
        fmi2_tell(&wanted, fmi2Error, "fmi2Instantiate: needs more memory than there is");
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
    if (!fmi2_allowed(s, "fmi2SetupExperiment", INSTANTIATED, 0, NULL, NULL)) {
        return fmi2Error;
    }
    if (!isfinite(start) || (with_stop && !(stop >= start))) {
        return fmi2_tell(s, fmi2Error, "fmi2SetupExperiment: from %g to %g s is no time span", start, stop);
    }
    s->model->time = start;
    s->model->outdated = 1;
    return fmi2OK;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c) {
    Instance *s = c;
    if (!fmi2_allowed(s, "fmi2EnterInitializationMode", INSTANTIATED, 0, NULL, NULL)) {
        return fmi2Error;
    }
    s->model->mode = INITIALIZATION;
    return fmi2OK;
}

fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
    Instance *s = c;
    if (!fmi2_allowed(s, "fmi2ExitInitializationMode", INITIALIZATION, 0, NULL, NULL)) {
        return fmi2Error;
    }
    s->model->outdated = 1;
    model_update(s->model);
    s->model->mode = STEP;
    return fmi2OK;
}

fmi2Status fmi2Terminate(fmi2Component c) {
    Instance *s = c;
    if (!fmi2_allowed(s, "fmi2Terminate", STEP, 0, NULL, NULL)) {
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
    s->terminated = 0;
    return fmi2OK;
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real from, fmi2Real size, fmi2Boolean keep_no_state) {
    Instance *s = c;
    char text[MODEL_TEXT_SIZE];
    (void)keep_no_state;
    if (!fmi2_allowed(s, "fmi2DoStep", STEP, 0, NULL, NULL)) {
        return fmi2Error;
    }
    if (!(size > 0.0) || !isfinite(from + size)) {
        return fmi2_tell(s, fmi2Error, "fmi2DoStep: a step of %g s from %g s found, must be positive", size, from);
    }
    model_update(s->model);
    s->model->time = from;
    const int status = s->model->behaviour->step(s->model, from + size, text);
    s->model->outdated = 1;
    if (status == STATUS_OK) {
        s->terminated = 0;
        return fmi2OK;
    }
    /* Importers that go on all the same would get the message in every step. */
    if (!s->terminated) {
        s->terminated = 1;
        s->last_successful_time = from;
        fmi2_tell(s, (fmi2Status)status, "%s", text);
    }
    return (fmi2Status)status;
}

/* Of FMI 2.0.5, 4.2.2: what an importer asks for after fmi2Discard. */
fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Real *value) {
    const Instance *s = c;
    if (s == NULL || value == NULL) {
        return fmi2Error;
    }
    if (kind != fmi2LastSuccessfulTime) {
        return fmi2Discard;
    }
    *value = s->terminated ? s->last_successful_time : s->model->time;
    return fmi2OK;
}

fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Boolean *value) {
    const Instance *s = c;
    if (s == NULL || value == NULL) {
        return fmi2Error;
    }
    if (kind != fmi2Terminated) {
        return fmi2Discard;
    }
    *value = s->terminated ? fmi2True : fmi2False;
    return fmi2OK;
}
