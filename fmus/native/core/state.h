/* FMU states: mode and time of an instance, and the state of its model, in memory and as bytes. */

#ifndef STATE_H
#define STATE_H

#include "instance.h"

/* Number of bytes of a serialised state. */
size_t state_size(const Instance *instance);

/* Functions of the fronts do the same as these, and give their names for messages.

   Write the state of an instance to *state: into the FMU state of its resource that is there, or a new one. Return a
   status. */
int state_get(Instance *instance, const char *function, void **state);

/* Return to a state of this or another instance of the same FMU. A status. */
int state_set(Instance *instance, const void *state);

/* Free *state and set it to NULL. A status. */
int state_free(const Instance *instance, void **state);

/* The number of bytes of an FMU state, to them and from them. Statuses. */
int state_serialized_size(const Instance *instance, const char *function, const void *state, size_t *size);
int state_serialize(Instance *instance, const char *function, const void *state, void *bytes, size_t size);
int state_deserialize(Instance *instance, const char *function, const void *bytes, size_t size, void **state);

#endif
