/* The estimator behind the fronts of FMI and in the memory of a caller. */

#ifndef INTERFACE_H
#define INTERFACE_H

#include "../estimator.h"

/* Variables of the estimator by number: what each stands for. estimator_variables.c lists them. */

static inline Estimator *estimator_of(const Model *model) {
    return (Estimator *)(uintptr_t)model; /* its first member */
}

/* What a variable stands for. First what estimator_outputs computes: a number of estimator->output, of the nonlinear
   estimator's real outputs or flags, of the values of other loads. Then one of inputs.value, of inputs.valid, of the tare; a
   zero in use; the score of a flow parameter. */
typedef enum {
    OUTPUT, AIR_DATA, FLIGHT_FLAG, OTHER_LOAD, INPUT, VALID, TARE_INPUT, TARE_STATE, ZERO_IN_USE, SCORE, USABLE, NOTHING
} VariableKind;

typedef struct {
    VariableKind kind;
    size_t place; /* among those of its kind */
} Variable;

/* The variable of a number; NOTHING where there is none. */
Variable variable_of(const Estimator *e, size_t number);

/* Its type; NO_VARIABLE for NOTHING. */
Type variable_type(const Estimator *e, Variable variable);

/* Value reference of FMI 3.0 of the time, behind all arrays. */
unsigned time_reference(const Estimator *e);

/* The estimator as a model of the fronts of FMI, and as one in the memory of a caller. */

/* An estimator of the map in bytes [length], which must outlive it, in blocks of `memory`, which the caller frees, also if
   it fails. NULL with a text. */
Estimator *estimator_in(Memory *memory, const unsigned char *bytes, size_t length, char text[MODEL_TEXT_SIZE]);

/* What a result rests on: covariances, residuals and the gauges in use, of the last outputs of an estimator. */

/* Places of the fit of a result; behind them (n_gauges) standardised residuals, gauges in use, and suspects. */
enum {
    LOAD_COVARIANCE = 0,                                              /* (5, 5) about the moment point of the settings */
    COEFFICIENT_COVARIANCE = LOAD_COVARIANCE + N_LOADS * N_LOADS,     /* (5, 5) [1] */
    FITS = COEFFICIENT_COVARIANCE + N_LOADS * N_LOADS,                /* whether strain and air data fit the map */
    FLIGHT_STATE,                                                     /* (4) M, u, w, ln p; NaN for linear maps, */
    FLIGHT_STATE_COVARIANCE = FLIGHT_STATE + N_STATES,                /* (4, 4) as the next */
    AIR_DATA_RESIDUAL = FLIGHT_STATE_COVARIANCE + N_STATES * N_STATES, /* (3) standardised: M, p, q */
    DISCREPANCY_CHI_SQUARE = AIR_DATA_RESIDUAL + N_NAVIGATION,        /* of the discrepancy modes in the residual */
    RESIDUAL_LIMIT,                                                   /* detection threshold of the largest |z| */
    NOISE_LEFT,                                                       /* part of the variance of noise; 1 of a sample alone */
    OF_GAUGES
};

/* Degrees of freedom of the chi-square of the outputs; 0 where nothing checks the estimate. */
double degrees_of_freedom(const Estimator *e);

/* Write the fit of the outputs, which must be of the present inputs. */
void write_fit(Estimator *e, double *fit);

#endif
