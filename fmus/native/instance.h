/* An instance of the FMU: an estimator, the mode it is in, and where its messages go. Both FMI versions use it.

   Status numbers are those of FMI 2.0 and 3.0 alike. */

#ifndef INSTANCE_H
#define INSTANCE_H

#include "estimator.h"

#define STATUS_OK 0
#define STATUS_ERROR 3

#define CATEGORY_ERROR "logStatusError"
#define CATEGORY_EVENTS "logEvents"

typedef enum {
    INSTANTIATED = 1,
    INITIALIZATION = 2,
    STEP = 4,
    EVENT = 8,
    CONTINUOUS_TIME = 16,
    TERMINATED = 32,
    CONFIGURATION = 64
} Mode;

typedef enum { MODEL_EXCHANGE_2 = 1, CO_SIMULATION_2, MODEL_EXCHANGE_3, CO_SIMULATION_3 } Kind;

typedef struct Instance Instance;

/* Hands a message to the logger of the importer, which each FMI version calls in its own way. */
typedef void LogWriter(const Instance *instance, int status, const char *category, const char *text);

struct Instance {
    Estimator *estimator;
    Kind kind;
    Mode mode;
    int event_mode_used; /* FMI 3.0 co-simulation */
    double time;
    const char *name;
    char *own_name;
    double *direction; /* (n_gauges + N_SCALAR_INPUTS) scratch of derivatives */
    LogWriter *write;
    void (*logger)(void); /* of the importer, NULL for none */
    void *environment;    /* that it wants back */
    int events_logged;
    int logged_health;
};

/* Fill in an instance of which name, kind, write, logger and environment are set, from the map in the folder
   `location`. Return a copy that is to be freed with instance_free; NULL, after a message, if guid is not that of the
   map or the map cannot be read. */
Instance *instance_create(const Instance *wanted, const char *guid, const char *location);

void instance_free(Instance *instance);

/* Back to the start values. */
void instance_reset(Instance *instance);

/* Whether the instance is in one of the modes (a sum); if not, a message says so. 0 for no instance. */
int instance_allows(Instance *instance, const char *function, int modes);

/* Log a message as printf does; STATUS_ERROR. */
int instance_error(const Instance *instance, const char *format, ...);

/* Log a change of health, if the importer wants to hear of events. */
void instance_log_health(Instance *instance);

#endif
