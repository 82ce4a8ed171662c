/* What a result rests on: covariances, residuals and the gauges in use, of the last outputs of an estimator. */

#ifndef FIT_H
#define FIT_H

#include "../estimator.h"

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
