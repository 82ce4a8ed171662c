/* The estimator as a model: made in the memory of a caller, its state as bytes. */

#ifndef ESTIMATOR_STATE_H
#define ESTIMATOR_STATE_H

#include "../estimator.h"

/* Of MODEL: whether bytes of a state may be read. */
int estimator_check_state(const Model *model, const unsigned char *bytes, char text[MODEL_TEXT_SIZE]);

/* An estimator of the map in bytes [length], which must outlive it, in blocks of `memory`, which the caller frees, also if
   it fails. NULL with a text. */
Estimator *estimator_in(Memory *memory, const unsigned char *bytes, size_t length, char text[MODEL_TEXT_SIZE]);

#endif
