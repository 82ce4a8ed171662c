/* The state of the estimator as bytes. */

#ifndef ESTIMATOR_STATE_H
#define ESTIMATOR_STATE_H

#include "../../core/model.h"

/* Of MODEL: whether bytes of a state may be read. */
int estimator_check_state(const Model *model, const unsigned char *bytes, char text[MODEL_TEXT_SIZE]);

#endif
