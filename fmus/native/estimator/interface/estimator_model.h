/* The estimator as a model of the fronts of FMI, and as one in the memory of a caller. */

#ifndef ESTIMATOR_MODEL_H
#define ESTIMATOR_MODEL_H

#include "../estimator.h"

/* An estimator of the map in bytes [length], which must outlive it, in blocks of `memory`, which the caller frees, also if
   it fails. NULL with a text. */
Estimator *estimator_in(Memory *memory, const unsigned char *bytes, size_t length, char text[MODEL_TEXT_SIZE]);

#endif
