#include "instance.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "uri_path.h"

#define TEXT_SIZE 1400
#define PATH_SIZE 4096
#define SHOWN_PATH 1000 /* characters of a path that a message shows */

int instance_error(const Instance *instance, const char *format, ...) {
    char text[TEXT_SIZE];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    instance->write(instance, STATUS_ERROR, CATEGORY_ERROR, text);
    return STATUS_ERROR;
}

/* The estimator of the map in a folder; NULL after a message. */
static Estimator *estimator_of(const Instance *instance, const char *guid, const char *location) {
    char path[PATH_SIZE], text[MAP_TEXT_SIZE];
    if (guid == NULL || location == NULL) {
        instance_error(instance, "%s is missing", guid == NULL ? "the guid" : "the resource location");
        return NULL;
    }
    if (!resource_path(location, "map.bin", path, sizeof path)) {
        instance_error(instance, "resource location '%.*s' is no file URI or path", SHOWN_PATH, location);
        return NULL;
    }
    size_t length;
    unsigned char *bytes = map_read(path, &length, text);
    Estimator *estimator = bytes != NULL ? estimator_create(bytes, length, text) : NULL;
    if (estimator == NULL) {
        instance_error(instance, "%.*s %s", SHOWN_PATH, path, text);
        return NULL;
    }
    if (strcmp(estimator->map.guid, guid) != 0) {
        instance_error(instance, "guid '%.100s' found, but the map in this FMU is '%s'", guid, estimator->map.guid);
        estimator_free(estimator);
        return NULL;
    }
    return estimator;
}

Instance *instance_create(const Instance *wanted, const char *guid, const char *location) {
    Estimator *estimator = estimator_of(wanted, guid, location);
    if (estimator == NULL) {
        return NULL;
    }
    const char *name = wanted->name != NULL ? wanted->name : "";
    Instance *instance = calloc(1, sizeof *instance);
    char *own_name = malloc(strlen(name) + 1);
    double *direction = calloc(estimator->map.n_gauges + N_SCALAR_INPUTS, sizeof *direction);
    if (instance == NULL || own_name == NULL || direction == NULL) {
        free(instance);
        free(own_name);
        free(direction);
        estimator_free(estimator);
        instance_error(wanted, "needs more memory than there is");
        return NULL;
    }
    *instance = *wanted;
    instance->estimator = estimator;
    instance->name = instance->own_name = strcpy(own_name, name);
    instance->direction = direction;
    instance_reset(instance);
    return instance;
}

void instance_free(Instance *instance) {
    if (instance != NULL) {
        estimator_free(instance->estimator);
        free(instance->own_name);
        free(instance->direction);
        free(instance);
    }
}

void instance_reset(Instance *instance) {
    estimator_reset(instance->estimator);
    instance->mode = INSTANTIATED;
    instance->time = 0.0;
    instance->logged_health = OK;
}

static const char *mode_name(Mode mode) {
    switch (mode) {
    case INSTANTIATED: return "just instantiated";
    case INITIALIZATION: return "in initialization mode";
    case STEP: return "in step mode";
    case EVENT: return "in event mode";
    case CONTINUOUS_TIME: return "in continuous-time mode";
    case TERMINATED: return "terminated";
    case CONFIGURATION: return "in configuration mode";
    }
    return "in no mode";
}

int instance_allows(Instance *instance, const char *function, int modes) {
    if (instance == NULL) {
        return 0;
    }
    if ((int)instance->mode & modes) {
        return 1;
    }
    instance_error(instance, "%s is not allowed: the instance is %s", function, mode_name(instance->mode));
    return 0;
}

void instance_log_health(Instance *instance) {
    static const char *const STATES[] = {
        "OK", "INCONSISTENT", "NO_COEFFICIENTS", "INVALID", "DEGRADED", "UNIDENTIFIED", "SUSPECT",
    };
    if (!instance->events_logged) {
        return;
    }
    const double *output = estimator_outputs(instance->estimator);
    const int health = (int)output[HEALTH_STATE];
    if (health == instance->logged_health) {
        return;
    }
    char text[TEXT_SIZE];
    snprintf(text, sizeof text,
             "health %s at %g s: %.0f gauges in use, chi-square %.4g (limit %.4g), suspect gauge %.0f", STATES[health],
             instance->time, output[VALID_GAUGES], output[CHI_SQUARE], output[CHI_SQUARE_LIMIT], output[SUSPECT_GAUGE]);
    instance->logged_health = health;
    instance->write(instance, STATUS_OK, CATEGORY_EVENTS, text);
}
