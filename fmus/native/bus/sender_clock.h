/* The clock of a sender, read from compiled code. */

#ifndef SENDER_CLOCK_H
#define SENDER_CLOCK_H

#include "strainbus.h"

/* Take in a sample time that arrived at `local` [s] with a counter, -1 without; the flags of sb_clock_read. */
int64_t clock_read(SbClock *clock, double local, int64_t ticks, int64_t counter);

/* What shows that a restarted clock is the sender's. */
enum { CLOCK_CONTINUES, CLOCK_BEGAN, CLOCK_COUNTER_CONTINUES };

/* Bound the delay that a clock which has been taken for restarted may hide, by the last reading before it; `counter` is the
   present one, -1 without. */
void clock_bound_restart(SbClock *clock, int evidence, int64_t counter);

/* Follow a clock that begins with this sample time; `old` is the one before. */
void clock_begin(SbClock *clock, const SbModel *old, double local, int64_t ticks);

/* By how much a sample time is ahead of the accepted clock at `local` [s]. */
double clock_seconds_ahead(const SbClock *clock, double local, int64_t ticks);

#endif
