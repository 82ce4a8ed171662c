/* A model of one of the FMUs round the estimator - plant, autopilot, schedule - and what FMI needs to know of it.

   One library serves all three: resources/model.bin says which one an FMU is, lists its variables, and holds its data.
   strainfmu/fmu/plant_resource.py writes that file. Variables, states and time are float64 throughout, whole numbers
   and truth values too, so that one array is the state of an instance. */

#ifndef MODEL_H
#define MODEL_H

#include <stddef.h>
#include <stdint.h>

#define MODEL_FORMAT_VERSION 1
#define MODEL_TEXT_SIZE 256 /* longest message of a model, with its final zero */

#define STATUS_OK 0
#define STATUS_DISCARD 2
#define STATUS_ERROR 3

#define STATE_OF_ANOTHER_MODEL "is that of another FMU, or of another version of it"

typedef enum { REAL, INTEGER, BOOLEAN } Type;
typedef enum { OUTPUT, INPUT, FIXED_PARAMETER, TUNABLE_PARAMETER } Causality;

/* INSTANTIATED and INITIALIZATION come before the first step: only then fixed parameters may be set. */
typedef enum { INSTANTIATED = 1, INITIALIZATION = 2, STEP = 4, TERMINATED = 8 } Mode;

typedef struct Model Model;

/* What a kind of model does. Functions that can fail return a status and write a text. */
typedef struct {
    /* Check the data, and say how many states and how much workspace the model has. */
    int (*prepare)(Model *model, char text[MODEL_TEXT_SIZE]);
    /* Set the states from start values and parameters. */
    void (*begin)(Model *model);
    /* Compute outputs from states and inputs; without inputs that changed, once more gives the same. */
    void (*outputs)(Model *model);
    /* Go on to `end` [s]; outputs are those of the time before, then outdated. */
    int (*step)(Model *model, double end, char text[MODEL_TEXT_SIZE]);
} Behaviour;

extern const Behaviour PLANT, AUTOPILOT, SCHEDULE;

struct Model {
    const Behaviour *behaviour;
    unsigned char *bytes; /* of model.bin */
    const char *guid;
    uint32_t checksum;
    size_t n_variables, n_data, n_states, n_work;
    const double *type, *causality, *start, *minimum, *maximum; /* (n_variables) of each variable */
    const double *data;                                         /* (n_data) of the model */
    double *memory;                                             /* of the arrays below */
    double *value, *state, *work;
    double time;
    Mode mode;
    int outdated; /* whether outputs must be computed before they are read */
};

/* Make a model of the bytes of a model.bin [length], which it frees; NULL with a text that says what is wrong. */
Model *model_create(unsigned char *bytes, size_t length, char text[MODEL_TEXT_SIZE]);

void model_free(Model *model);

/* Back to the start values. */
void model_reset(Model *model);

/* Compute the outputs if something has changed. */
void model_update(Model *model);

/* Whether a variable exists and is of a type. */
int model_has(const Model *model, size_t variable, Type type);

/* Set a variable that model_has. A status. */
int model_set(Model *model, size_t variable, double value, char text[MODEL_TEXT_SIZE]);

/* Serialised states: their size, writing one, and returning to one; STATUS_ERROR, with a text, for any that is none of
   this FMU. */
size_t model_state_size(const Model *model);
void model_write_state(const Model *model, unsigned char *bytes);
int model_check_state(const Model *model, const unsigned char *bytes, size_t size, char text[MODEL_TEXT_SIZE]);
void model_read_state(Model *model, const unsigned char *bytes);

#endif
