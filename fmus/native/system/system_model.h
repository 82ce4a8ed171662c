/* A model of the system around the estimator: plant, autopilot or schedule, as resources/model.bin chooses.

   The file lists the variables and holds the data; strainfmu/fmu/plant_resource.py writes it. Variables, states and
   time are float64 throughout, whole numbers and truth values too, so that one array is the state of an instance. */

#ifndef SYSTEM_MODEL_H
#define SYSTEM_MODEL_H

#include "../core/model.h"

#define SYSTEM_FORMAT_VERSION 2

typedef enum { OUTPUT, INPUT, FIXED_PARAMETER, TUNABLE_PARAMETER } Causality;

typedef struct SystemModel SystemModel;

/* What a kind of model does. Functions that can fail return a status and write a text. */
typedef struct {
    /* Check the data, and set how many states and how much workspace the model has. */
    int (*prepare)(SystemModel *model, char text[MODEL_TEXT_SIZE]);
    /* Set the states from start values and parameters; NULL for nothing. */
    void (*begin)(SystemModel *model);
    /* Compute outputs from states and inputs; without inputs that changed, once more gives the same. NULL where they change in
       steps alone. */
    void (*outputs)(SystemModel *model);
    /* Go on to `end` [s]; outputs are of the time before, then outdated. */
    int (*step)(SystemModel *model, double end, char text[MODEL_TEXT_SIZE]);
} Behaviour;

extern const Behaviour PLANT, AUTOPILOT, SCHEDULE;

struct SystemModel {
    Model base;
    const Behaviour *behaviour;
    unsigned char *bytes; /* of model.bin */
    size_t n_variables, n_data, n_states, n_work;
    const double *type, *causality, *start, *minimum, *maximum; /* (n_variables) of each variable */
    const double *data;                                         /* (n_data) of the model */
    double *memory;                                             /* of the arrays below */
    double *value, *state, *work;
    int outdated; /* whether outputs must be computed before they are read */
};

#endif
