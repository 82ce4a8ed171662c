/* An instance of an FMU: a model, and where its messages go. Both fronts use it. */

#ifndef INSTANCE_H
#define INSTANCE_H

#include "ports.h"

#define CATEGORY_ALL "logAll"
#define CATEGORY_DISCARD "logStatusDiscard"
#define CATEGORY_ERROR "logStatusError"
#define CATEGORY_EVENTS "logEvents"

/* Sums of modes. FMI 2.0 never comes to CONFIGURATION. */
#define RUNNING (STEP | EVENT | CONTINUOUS_TIME)
#define SETTABLE (BEFORE_STEPS | RUNNING)
#define READABLE (SETTABLE | TERMINATED)

typedef enum { MODEL_EXCHANGE_2 = 1, CO_SIMULATION_2, MODEL_EXCHANGE_3, CO_SIMULATION_3 } Kind;

typedef struct Instance Instance;

/* Hands a message to the logger of the importer, which each FMI version calls in its own way. */
typedef void LogWriter(const Instance *instance, int status, const char *category, const char *text);

struct Instance {
    Model *model;
    Kind kind;
    int ending;                  /* whether the last step was discarded: the model wants to end */
    double last_successful_time; /* [s] then the end of the last step that was not */
    double stop_time;            /* [s] of the experiment, infinite for none */
    const char *name;
    char *own_name;
    LogWriter *write;
    void (*logger)(void); /* of the importer, NULL for none */
    void *environment;    /* that is passed back to it */
    int events_logged;
    const NodeKind *const *kinds; /* of nodes, of the front; NULL for none */
    Node *node;                   /* NULL without one */
    double stated_due[MAX_PORTS]; /* ticks of the clocks that the importer knows of [s] */
};

/* Fill in an instance of which name, kind, write, logger and environment are set, from the resource in the folder
   `location`. Return a copy that is to be freed with instance_free; NULL, after a message, if guid is not the
   resource's or the resource cannot be read. */
Instance *instance_create(const Instance *requested, const char *guid, const char *location);

void instance_free(Instance *instance);

/* Back to the start values. */
void instance_reset(Instance *instance);

/* Log that a function is not allowed in the mode of the instance, or that an argument is NULL; 0. */
int instance_refuse_mode(const Instance *instance, const char *function);
int instance_refuse_null(const Instance *instance, const char *function);

/* Whether the instance is in one of the modes (a sum); if not, a message reports it. 0 for no instance. */
static inline int instance_allows(const Instance *instance, const char *function, int modes) {
    return instance != NULL
        && (((int)instance->model->mode & modes) != 0 || instance_refuse_mode(instance, function));
}

/* Whether an argument is there; if not, a message reports it. */
static inline int instance_given(const Instance *instance, const char *function, const void *argument) {
    return argument != NULL || instance_refuse_null(instance, function);
}

/* Whether lists of so many references and values are there. */
static inline int instance_lists(const Instance *instance, const char *function, size_t n, const void *references,
                                 const void *values) {
    return n == 0 || (instance_given(instance, function, references) && instance_given(instance, function, values));
}

/* Go from one of the modes `from` to `to`, or set the time. A status. */
int instance_enter(Instance *instance, const char *function, int from, Mode to);
int instance_set_time(Instance *instance, const char *function, int modes, double time);

/* Set the times at which an experiment starts and stops, if from start to stop is a time span. A status. */
int instance_start_at(Instance *instance, const char *function, double start, int has_stop, double stop);

/* Leave the initialization for `mode`. A status. */
int instance_end_initialization(Instance *instance, const char *function, Mode mode);

/* Model exchange: go from event mode to continuous-time mode, where discrete outputs keep the values of the event; and
   end a step of the solver, *event being whether they have others by now, which take another event. A status. */
int instance_go_on(Instance *instance, const char *function, int from);
int instance_end_solver_step(Instance *instance, const char *function, int *event);

/* The importer knows of no tick of any clock. */
void instance_forget_ticks(Instance *instance);

/* Let an event take discrete inputs in: model exchange alone, for the steps of co-simulation do. */
void instance_follow_event(Instance *instance);

/* One step of co-simulation, which must not end behind the stop time. A status. */
int instance_step(Instance *instance, const char *function, double start, double size);

/* A list of continuous states or event indicators, of which there are none: its length must be 0. A status. */
int instance_empty_list(Instance *instance, const char *function, int modes, size_t length);

/* Value references as a front gets them, the variables that it has for each, and the number of values that come with all. */
typedef struct {
    const unsigned *reference;
    size_t count, n_values;
    Selection (*variables)(const Instance *instance, unsigned reference);
} References;

/* Partial derivatives of real outputs, the unknowns, by real inputs and parameters, the knowns: along a seed of the knowns, or
   of the unknowns weighted with a seed, by each known. A status. */
int instance_derivative(Instance *instance, const char *function, const References *unknowns, const References *knowns,
                        const double *seed, double *sensitivity, int is_adjoint);

/* Log a message as printf does; STATUS_ERROR. */
int instance_error(const Instance *instance, const char *format, ...);

/* Log that a function is not offered; STATUS_ERROR, also for no instance. */
int instance_not_offered(const Instance *instance, const char *function);

/* Request events or not: of all categories for an empty list, or where it names theirs. A status. */
int instance_set_logging(Instance *instance, const char *function, int on, size_t n, const char *const categories[]);

/* Log an event of the model, if the importer requests events. */
void instance_log_event(Instance *instance);

#endif
