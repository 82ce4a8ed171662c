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

/* What a result rests on: covariances, residuals and the gauges in use, of the last outputs of an estimator. */

/* Fields of the fit of a result, as OUTPUT_FIELDS; behind them (n_gauges) standardised residuals, gauges in use, and suspects. */
#define FIT_FIELDS(X)                                                                                            \
    X(LOAD_COVARIANCE, "load_covariance", N_LOADS * N_LOADS) /* (5, 5) about the moment point of the settings */ \
    X(COEFFICIENT_COVARIANCE, "coefficient_covariance", N_LOADS * N_LOADS) /* (5, 5) [1] */                      \
    X(FITS, "fits", 1) /* whether strain and air data fit the map */                                             \
    X(FLIGHT_STATE, "state", N_STATES) /* (4) M, u, w, ln p; NaN for linear maps, */                             \
    X(FLIGHT_STATE_COVARIANCE, "state_covariance", N_STATES * N_STATES) /* (4, 4) as the next */                 \
    X(AIR_DATA_RESIDUAL, "air_data_residual", N_NAVIGATION) /* (3) standardised: M, p, q */                      \
    X(DISCREPANCY_CHI_SQUARE, "discrepancy_chi_square", 1) /* of the discrepancy modes in the residual */        \
    X(RESIDUAL_LIMIT, "residual_limit", 1) /* detection threshold of the largest |z| */                          \
    X(NOISE_LEFT, "noise_left", 1) /* part of the variance of noise; 1 of a sample alone */
enum { FIT_FIELDS(FIELD_PLACE) OF_GAUGES };

/* Degrees of freedom of the chi-square of the outputs; 0 where nothing checks the estimate. */
double degrees_of_freedom(const Estimator *e);

/* Write the fit of the outputs, which must be of the present inputs. */
void write_fit(Estimator *e, double *fit);

#endif
