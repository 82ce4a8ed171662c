/* The step of a map in form "absolute": the gain is fixed, and so is the covariance of the loads. */

#ifndef ABSOLUTE_FORM_H
#define ABSOLUTE_FORM_H

#include "../estimator.h"

/* Set all outputs but the number of gauges and the health, where the gauges in use identify the state. */
void absolute_update(Estimator *e);

#endif
