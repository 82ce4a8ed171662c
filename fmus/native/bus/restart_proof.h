/* The proof that a sender whose time has jumped is no recording. */

#ifndef RESTART_PROOF_H
#define RESTART_PROOF_H

#include "strainbus.h"

/* Take in a cycle with sample time, and the flags of the clock's reading; 1 if its sender has been proven with it.
   `is_new`: no frame of the cycle has been received before. */
int proof_take(SbProof *proof, const SbClock *clock, int64_t reading, double local, int64_t ticks, int64_t counter,
               int is_new);

/* Whether time and counter have begun again after a pause, of a sender that is accepted so: a sample time that wraps
   early makes a restart look like a delay. The sender is to be confirmed then. */
int proof_begins_again(SbProof *proof, const SbClock *clock, double local, int64_t ticks, int64_t counter);

/* Take in a cycle without sample time: behind a pause it may be a recording until it is new. */
void proof_take_untimed(SbProof *proof, double local, int is_new);

#endif
