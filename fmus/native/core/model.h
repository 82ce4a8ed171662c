/* The contract between a model and the FMI fronts: all that fmi2/ and fmi3/ know of a model.

   A library holds one implementation, in MODEL: the estimator's (estimator/estimator_model.c), or the one of the
   system around it (system/system_model.c), where resources/model.bin chooses plant, autopilot or schedule.

   Scalar variables have numbers, which are the value references of FMI 2.0. FMI 3.0 collects them in arrays.
   Functions that can fail write a message to text, of at most MODEL_TEXT_SIZE bytes with its final zero. */

#ifndef MODEL_H
#define MODEL_H

#include <stddef.h>
#include <stdint.h>

#define MODEL_TEXT_SIZE 256

/* Status numbers of FMI 2.0 and 3.0 alike. */
#define STATUS_OK 0
#define STATUS_DISCARD 2
#define STATUS_ERROR 3

#define WRONG_TYPE "value reference %lu is no variable of that type"

typedef enum { REAL, INTEGER, BOOLEAN, ENUMERATION, TEXT, NO_VARIABLE } Type; /* no variable is a TEXT */

/* Modes of an instance; sums of them are sets of modes. */
typedef enum {
    INSTANTIATED = 1,
    INITIALIZATION = 2,
    STEP = 4,
    EVENT = 8,
    CONTINUOUS_TIME = 16,
    TERMINATED = 32,
    CONFIGURATION = 64
} Mode;

/* What comes before the first step or event. */
#define BEFORE_STEPS (INSTANTIATED | CONFIGURATION | INITIALIZATION)

/* What every model begins with. */
typedef struct {
    const char *guid;
    uint32_t checksum;       /* of its resource */
    Mode mode;               /* set by the front */
    double time;             /* [s], set by model_set_time and model_step */
    int co_simulation_only;  /* whether its outputs depend on the steps before */
    unsigned time_reference; /* value reference of the independent variable in FMI 3.0; arrays have those below it */
} Model;

/* Variables by number: `count` from `first` on, or those listed. */
typedef struct {
    const unsigned *listed; /* NULL for a run */
    size_t first, count;
} Selection;

static inline size_t selected(const Selection *selection, size_t k) {
    return selection->listed != NULL ? selection->listed[k] : selection->first + k;
}

/* What a library implements. Functions that compute have their place here; those below call them. */
typedef struct {
    const char *resource;           /* name of its file in resources/ */
    const char *content;            /* what messages call the content of that file */
    const char *foreign_state;      /* what a message reports of the state of another resource */
    int model_exchange;             /* whether it serves model exchange, without continuous states and indicators */
    Model *(*create)(unsigned char *bytes, size_t length, char text[MODEL_TEXT_SIZE]);
    void (*reset)(Model *model);
    int (*step)(Model *model, double start, double end, char text[MODEL_TEXT_SIZE]);
    void (*end_initialization)(Model *model); /* this and the next five: NULL where nothing happens */
    void (*follow_event)(Model *model);       /* model exchange: an event takes discrete inputs in, */
    void (*accept_step)(Model *model);        /* a step of the solver is accepted, */
    void (*settle)(Model *model);             /* discrete outputs take the values of the inputs */
    int (*unsettled)(Model *model);
    int (*event)(Model *model, char text[MODEL_TEXT_SIZE]);
    int (*get)(Model *model, Type type, const Selection *which, void *value, char text[MODEL_TEXT_SIZE]);
    int (*set)(Model *model, Type type, const Selection *which, const void *value, char text[MODEL_TEXT_SIZE]);
    /* Partial derivatives of some real outputs, values, by real inputs and parameters: all four NULL for none. The index of a
       variable among the inputs, or among the outputs; SIZE_MAX for any other variable. */
    size_t (*input_index)(const Model *model, size_t variable);
    size_t (*output_index)(const Model *model, size_t variable);
    /* The direction to derive along, by input index, set to zero; it belongs to the model. */
    double *(*clear_direction)(Model *model);
    /* Derivatives along the direction, by output index; NaN where the output is. NULL, after a message, where the
       model has none in its present state. */
    const double *(*along_direction)(Model *model, char text[MODEL_TEXT_SIZE]);
} ModelFacts;

extern const ModelFacts MODEL;

/* Functions that compute do so in the default floating-point environment, whatever the host's is (floating.h); who
   calls the functions of derivatives takes it for them. */

/* Make a model of the bytes of its resource [length], and own them: they are freed here if that fails. NULL, after a
   message. */
Model *model_create(unsigned char *bytes, size_t length, char text[MODEL_TEXT_SIZE]);

void model_destroy(Model *model);

/* Back to the start values; mode and time are the caller's. */
void model_reset(Model *model);

void model_set_time(Model *model, double time);

/* Go on from start to end [s]. STATUS_DISCARD, after a message, if the model wants to end there. */
int model_step(Model *model, double start, double end, char text[MODEL_TEXT_SIZE]);

/* One of the functions of MODEL that may be NULL for nothing. */
void model_notice(Model *model, void (*function)(Model *model));

/* Whether discrete outputs would take others than the values that they keep in continuous-time mode. */
int model_unsettled(Model *model);

/* Whether something has happened that was not reported before; then it is in text. */
int model_event(Model *model, char text[MODEL_TEXT_SIZE]);

/* The type of a variable; an enumeration is read and set as integer. */
Type model_type_of(const Model *model, size_t variable);

/* The variables of an FMI 3.0 array; none if there is no such array. */
Selection model_array(const Model *model, unsigned reference);

/* Read or set variables of a type, whose values are double for REAL, int for BOOLEAN and for INTEGER, which has enumerations
   too. 1; 0, after a message, if one is of another type or refuses the value. Those before it in the selection may have been
   set then, it and those after it have not. */
int model_get(Model *model, Type type, const Selection *which, void *value, char text[MODEL_TEXT_SIZE]);
int model_set(Model *model, Type type, const Selection *which, const void *value, char text[MODEL_TEXT_SIZE]);

/* Whether a variable is read and set as one of a type; the value of variable k of a selection, and giving it one. */
static inline int is_read_as(Type type, Type as) {
    return type == as || (type == ENUMERATION && as == INTEGER);
}

static inline double value_at(Type type, const void *value, size_t k) {
    return type == REAL ? ((const double *)value)[k] : (double)((const int *)value)[k];
}

static inline void put_value(Type type, void *value, size_t k, double number) {
    if (type == REAL) {
        ((double *)value)[k] = number;
    } else {
        ((int *)value)[k] = (int)number;
    }
}

/* The model's part of a serialised state: its number of bytes, and writing it. Mode and time are the caller's. */
size_t model_state_size(const Model *model);
void model_write_state(const Model *model, unsigned char *bytes);

/* Whether bytes [model_state_size] may be read; if not, text states what is wrong. */
int model_check_state(const Model *model, const unsigned char *bytes, char text[MODEL_TEXT_SIZE]);
void model_read_state(Model *model, const unsigned char *bytes);

#endif
