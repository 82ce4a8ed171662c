/* The state of health of a sample, of both estimators: one table of conditions, in the order in which they count. */

#ifndef HEALTH_H
#define HEALTH_H

/* Names of the states of outputs.h, by number. */
extern const char *const HEALTH_NAMES[];

/* The state of the first row of the table whose condition holds; OK for none. conditions are bits of outputs.h. */
int health_state(int conditions);

#endif
