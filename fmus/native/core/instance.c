/* An instance of an FMU, for both FMI versions: creation from its resource, modes, steps, messages.

       instantiated -> initialization -> step (co-simulation) -> terminated
                                      -> event <-> continuous time (model exchange) -> terminated

   Each function of a front names the modes in which it is allowed, as a sum of bits, and gets a status; a refusal
   writes one line that states function and mode. A step is refused where its size is not positive or it ends behind
   the stop time of the experiment. A model that wants to end discards the step: the message comes once.
   docs/developers/native.md, "States, derivatives, messages". */

#include "instance.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "floating.h"
#include "resource.h"
#include "uri_path.h"

#define LINE_SIZE 1400
#define PATH_SIZE 4096
#define SHOWN_PATH 1000 /* characters of a path that a message shows */
#define ROUNDING 1e-2   /* largest error of a sum of a million step sizes, as a fraction of a step */

/* Times that an importer gives [s] are computed with by functions of their own, in the default floating-point environment:
   whether an experiment may span them; the end of a step, which may be of a size, and whether that is behind the stop time
   by more than sums of step sizes round. */
static int is_time_span(double start, int has_stop, double stop) {
    const Floating host = floating_enter();
    const int good = isfinite(start) && (!has_stop || stop >= start);
    floating_leave(&host);
    return good;
}

static int step_ends(double start, double size, double stop, double *end, int *is_beyond) {
    const Floating host = floating_enter();
    *end = start + size;
    *is_beyond = *end - stop > ROUNDING * size;
    const int good = size > 0.0 && isfinite(*end);
    floating_leave(&host);
    return good;
}

int instance_error(const Instance *instance, const char *format, ...) {
    char text[LINE_SIZE];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    instance->write(instance, STATUS_ERROR, CATEGORY_ERROR, text);
    return STATUS_ERROR;
}

int instance_not_offered(const Instance *instance, const char *function) {
    return instance == NULL ? STATUS_ERROR : instance_error(instance, "%s is not supported by this FMU", function);
}

/* The model of the resource in a folder; NULL after a message. */
static Model *model_in(const Instance *instance, const char *guid, const char *location) {
    char path[PATH_SIZE], text[MODEL_TEXT_SIZE];
    if (guid == NULL || location == NULL) {
        instance_error(instance, "%s is missing", guid == NULL ? "the guid" : "the resource location");
        return NULL;
    }
    if (!resource_path(location, MODEL.resource, path, sizeof path)) {
        instance_error(instance, "resource location '%.*s' is no file URI or path", SHOWN_PATH, location);
        return NULL;
    }
    size_t length;
    unsigned char *bytes = resource_read(path, &length, text);
    Model *model = bytes != NULL ? model_create(bytes, length, text) : NULL;
    if (model == NULL) {
        instance_error(instance, "%.*s %s", SHOWN_PATH, path, text);
        return NULL;
    }
    if (strcmp(model->guid, guid) != 0) {
        instance_error(instance, "guid '%.100s' found, but the %s in this FMU is '%s'", guid, MODEL.content,
                       model->guid);
        model_destroy(model);
        return NULL;
    }
    return model;
}

/* Make the node of the resource in a folder, if there is one; 0 after a message. */
static int make_node(Instance *instance, const char *location) {
    char path[PATH_SIZE], text[MODEL_TEXT_SIZE];
    size_t length;
    for (const NodeKind *const *kind = instance->kinds; kind != NULL && *kind != NULL; kind++) {
        if (resource_path(location, (*kind)->resource, path, sizeof path) && resource_exists(path)) {
            unsigned char *bytes = resource_read(path, &length, text);
            instance->node = bytes != NULL ? node_create(*kind, instance->model, bytes, length, text) : NULL;
            if (instance->node == NULL) {
                instance_error(instance, "%.*s %s", SHOWN_PATH, path, text);
                return 0;
            }
        }
    }
    return 1;
}

Instance *instance_create(const Instance *requested, const char *guid, const char *location) {
    if (requested->name[0] == '\0') {
        instance_error(requested, "the instance name is missing");
        return NULL;
    }
    Model *model = model_in(requested, guid, location);
    if (model == NULL) {
        return NULL;
    }
    const int for_model_exchange = requested->kind == MODEL_EXCHANGE_2 || requested->kind == MODEL_EXCHANGE_3;
    if (for_model_exchange && (model->co_simulation_only || !MODEL.model_exchange)) {
        model_destroy(model);
        instance_error(requested, "this FMU is for co-simulation");
        return NULL;
    }
    Instance *instance = calloc(1, sizeof *instance);
    char *own_name = malloc(strlen(requested->name) + 1);
    if (instance == NULL || own_name == NULL) {
        free(instance);
        free(own_name);
        model_destroy(model);
        instance_error(requested, "needs more memory than there is");
        return NULL;
    }
    *instance = *requested;
    instance->model = model;
    instance->name = instance->own_name = strcpy(own_name, requested->name);
    if (!make_node(instance, location)) {
        instance_free(instance);
        return NULL;
    }
    instance_reset(instance);
    return instance;
}

void instance_free(Instance *instance) {
    if (instance != NULL) {
        node_destroy(instance->node);
        model_destroy(instance->model);
        free(instance->own_name);
        free(instance);
    }
}

void instance_reset(Instance *instance) {
    Model *model = instance->model;
    model->mode = INSTANTIATED;
    model->time = 0.0;
    model_reset(model);
    if (instance->node != NULL) {
        node_begin(instance->node, 0.0);
    }
    instance->stop_time = INFINITY;
    instance->ending = 0;
    instance_forget_ticks(instance);
}

void instance_forget_ticks(Instance *instance) {
    for (int port = 0; port < MAX_PORTS; port++) {
        instance->stated_due[port] = INFINITY;
    }
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

int instance_refuse_mode(const Instance *instance, const char *function) {
    instance_error(instance, "%s is not allowed: the instance is %s", function, mode_name(instance->model->mode));
    return 0;
}

int instance_refuse_null(const Instance *instance, const char *function) {
    instance_error(instance, "%s: an argument is NULL", function);
    return 0;
}

int instance_enter(Instance *instance, const char *function, int from, Mode to) {
    if (!instance_allows(instance, function, from)) {
        return STATUS_ERROR;
    }
    instance->model->mode = to;
    return STATUS_OK;
}

int instance_set_time(Instance *instance, const char *function, int modes, double time) {
    if (!instance_allows(instance, function, modes)) {
        return STATUS_ERROR;
    }
    if (!isfinite(time)) {
        return instance_error(instance, "%s: %g is no time", function, time);
    }
    model_set_time(instance->model, time);
    return STATUS_OK;
}

int instance_start_at(Instance *instance, const char *function, double start, int has_stop, double stop) {
    if (!instance_allows(instance, function, INSTANTIATED)) {
        return STATUS_ERROR;
    }
    if (!is_time_span(start, has_stop, stop)) {
        return instance_error(instance, "%s: from %g to %g s is no time span", function, start, stop);
    }
    model_set_time(instance->model, start);
    instance->stop_time = has_stop ? stop : INFINITY;
    return STATUS_OK;
}

int instance_end_initialization(Instance *instance, const char *function, Mode mode) {
    if (!instance_allows(instance, function, INITIALIZATION)) {
        return STATUS_ERROR;
    }
    model_notice(instance->model, MODEL.end_initialization);
    if (instance->node != NULL) {
        node_begin(instance->node, instance->model->time);
    }
    instance->model->mode = mode;
    return STATUS_OK;
}

int instance_go_on(Instance *instance, const char *function, int from) {
    if (!instance_allows(instance, function, from)) {
        return STATUS_ERROR;
    }
    model_notice(instance->model, MODEL.settle);
    instance->model->mode = CONTINUOUS_TIME;
    return STATUS_OK;
}

int instance_end_solver_step(Instance *instance, const char *function, int *event) {
    if (!instance_allows(instance, function, CONTINUOUS_TIME)) {
        return STATUS_ERROR;
    }
    model_notice(instance->model, MODEL.accept_step);
    *event = model_unsettled(instance->model);
    instance_log_event(instance);
    return STATUS_OK;
}

void instance_follow_event(Instance *instance) {
    if (instance->node != NULL) {
        const Floating host = floating_enter();
        instance->node->kind->update(instance->node, instance->model->time);
        floating_leave(&host);
        instance_log_event(instance);
    } else if (instance->kind == MODEL_EXCHANGE_2 || instance->kind == MODEL_EXCHANGE_3) {
        model_notice(instance->model, MODEL.follow_event);
    }
}

/* Importers that go on after a discarded step would get the message in every step: it comes once. */
static int discard(Instance *instance, int status, double start, const char *text) {
    if (!instance->ending) {
        instance->ending = 1;
        instance->last_successful_time = start;
        instance->write(instance, status, status == STATUS_DISCARD ? CATEGORY_DISCARD : CATEGORY_ERROR, text);
    }
    return status;
}

int instance_step(Instance *instance, const char *function, double start, double size) {
    if (!instance_allows(instance, function, STEP)) {
        return STATUS_ERROR;
    }
    double end;
    int is_beyond;
    if (!step_ends(start, size, instance->stop_time, &end, &is_beyond)) {
        return instance_error(instance, "%s: a step of %g s from %g s found, must be positive", function, size, start);
    }
    if (is_beyond) {
        return instance_error(instance, "%s: the step ends at %.9g s, behind the stop time of the experiment, %.9g s", function,
                              end, instance->stop_time);
    }
    if (instance->node != NULL && !instance->node->kind->steps_model) {
        model_set_time(instance->model, end);
        return STATUS_OK;
    }
    char text[MODEL_TEXT_SIZE];
    const int status = model_step(instance->model, start, end, text);
    if (status != STATUS_OK) {
        return discard(instance, status, start, text);
    }
    instance->ending = 0;
    instance_log_event(instance);
    return STATUS_OK;
}

int instance_empty_list(Instance *instance, const char *function, int modes, size_t length) {
    if (!instance_allows(instance, function, modes)) {
        return STATUS_ERROR;
    }
    return length == 0 ? STATUS_OK
                       : instance_error(instance, "%s: length %lu found, must be 0", function, (unsigned long)length);
}

void instance_log_event(Instance *instance) {
    char text[MODEL_TEXT_SIZE];
    while (instance->events_logged && model_event(instance->model, text)) {
        instance->write(instance, STATUS_OK, CATEGORY_EVENTS, text);
    }
}

int instance_set_logging(Instance *instance, const char *function, int on, size_t n, const char *const categories[]) {
    if (instance == NULL || (n > 0 && !instance_given(instance, function, categories))) {
        return STATUS_ERROR;
    }
    instance->events_logged = on && n == 0;
    for (size_t i = 0; i < n; i++) {
        const char *category = categories[i] != NULL ? categories[i] : "";
        if (strcmp(category, CATEGORY_EVENTS) == 0 || strcmp(category, CATEGORY_ALL) == 0) {
            instance->events_logged = on;
        }
    }
    return STATUS_OK;
}

/* Partial derivatives. */

/* Log why there are no derivatives for the present values; STATUS_DISCARD. */
static int discard_derivative(const Instance *instance, const char *function, const char *why) {
    char text[LINE_SIZE];
    snprintf(text, sizeof text, "%s: %s", function, why);
    instance->write(instance, STATUS_DISCARD, CATEGORY_DISCARD, text);
    return STATUS_DISCARD;
}

/* Whether references are of variables that have derivatives, and of as many elements as the caller gives values. */
static int have_index(const Instance *instance, const References *of, size_t (*index_of)(const Model *, size_t)) {
    size_t total = 0;
    for (size_t i = 0; i < of->count; i++) {
        const Selection array = of->variables(instance, of->reference[i]);
        if (array.count == 0 || index_of(instance->model, array.first) == SIZE_MAX) {
            return 0;
        }
        total += array.count;
    }
    return total == of->n_values;
}

static int are_derivable(Instance *instance, const char *function, const References *unknowns, const References *knowns,
                         const double *of_unknowns, const double *of_knowns) {
    if (instance == NULL || MODEL.input_index == NULL) {
        instance_not_offered(instance, function);
        return 0;
    }
    if (!instance_allows(instance, function, INITIALIZATION | RUNNING)
        || !instance_lists(instance, function, unknowns->count, unknowns->reference, of_unknowns)
        || !instance_lists(instance, function, knowns->count, knowns->reference, of_knowns)) {
        return 0;
    }
    if (!have_index(instance, unknowns, MODEL.output_index) || !have_index(instance, knowns, MODEL.input_index)) {
        instance_error(instance, "%s: derivatives are those of values (loads, coefficients, air data) by real inputs and "
                       "parameters, as many values as these have elements", function);
        return 0;
    }
    return 1;
}

static int directional_derivative(Instance *instance, const char *function, const References *unknowns,
                                  const References *knowns, const double *seed, double *sensitivity) {
    if (!are_derivable(instance, function, unknowns, knowns, sensitivity, seed)) {
        return STATUS_ERROR;
    }
    double *direction = MODEL.clear_direction(instance->model);
    for (size_t i = 0; i < knowns->count; i++) {
        const Selection array = knowns->variables(instance, knowns->reference[i]);
        for (size_t k = 0; k < array.count; k++) {
            direction[MODEL.input_index(instance->model, array.first + k)] += *seed++;
        }
    }
    char text[MODEL_TEXT_SIZE];
    const double *derivative = MODEL.along_direction(instance->model, text);
    if (derivative == NULL) {
        return discard_derivative(instance, function, text);
    }
    for (size_t i = 0; i < unknowns->count; i++) {
        const Selection array = unknowns->variables(instance, unknowns->reference[i]);
        for (size_t k = 0; k < array.count; k++) {
            *sensitivity++ = derivative[MODEL.output_index(instance->model, array.first + k)];
        }
    }
    return STATUS_OK;
}

/* Sum of the derivatives of the unknowns, weighted with the seed. Where that is 0, a derivative that is not a number
   does not matter. */
static double weighted(const Instance *instance, const References *unknowns, const double *seed, const double *derivative) {
    double sum = 0.0;
    for (size_t i = 0; i < unknowns->count; i++) {
        const Selection array = unknowns->variables(instance, unknowns->reference[i]);
        for (size_t k = 0; k < array.count; k++, seed++) {
            const size_t index = MODEL.output_index(instance->model, array.first + k);
            sum += *seed != 0.0 ? *seed * derivative[index] : 0.0;
        }
    }
    return sum;
}

/* One directional derivative for each element of the knowns. */
static int adjoint_derivative(Instance *instance, const char *function, const References *unknowns,
                              const References *knowns, const double *seed, double *sensitivity) {
    if (!are_derivable(instance, function, unknowns, knowns, seed, sensitivity)) {
        return STATUS_ERROR;
    }
    for (size_t i = 0; i < knowns->count; i++) {
        const Selection array = knowns->variables(instance, knowns->reference[i]);
        for (size_t k = 0; k < array.count; k++) {
            char text[MODEL_TEXT_SIZE];
            MODEL.clear_direction(instance->model)[MODEL.input_index(instance->model, array.first + k)] = 1.0;
            const double *derivative = MODEL.along_direction(instance->model, text);
            if (derivative == NULL) {
                return discard_derivative(instance, function, text);
            }
            *sensitivity++ = weighted(instance, unknowns, seed, derivative);
        }
    }
    return STATUS_OK;
}

int instance_derivative(Instance *instance, const char *function, const References *unknowns, const References *knowns,
                        const double *seed, double *sensitivity, int is_adjoint) {
    const Floating host = floating_enter();
    const int status = (is_adjoint ? adjoint_derivative : directional_derivative)(instance, function, unknowns, knowns, seed,
                                                                                  sensitivity);
    floating_leave(&host);
    return status;
}
