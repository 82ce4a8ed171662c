/* The clock of a sender, read from compiled code. */

#ifndef SENDER_CLOCK_H
#define SENDER_CLOCK_H

#include "strainbus.h"

/* Take in a sample time that arrived at `local` [s]; the flags of sb_clock_read. */
int64_t clock_read(SbClock *clock, double local, int64_t ticks);

/* Follow a clock that begins with this sample time; `old` is the one before. */
void clock_begin(SbClock *clock, const SbModel *old, double local, int64_t ticks);

/* By how much a sample time is ahead of the accepted clock at `local` [s]. */
double clock_seconds_ahead(const SbClock *clock, double local, int64_t ticks);

#endif
