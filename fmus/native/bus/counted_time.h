/* Time by the counter of cycles next to the sender's clock, read from compiled code. */

#ifndef COUNTED_TIME_H
#define COUNTED_TIME_H

#include "strainbus.h"

/* Take in a reading of the known clock: sample time, delay and age by it [s], and by how much its floor was raised [s]. */
void count_take(SbCount *count, double tick, const SbModel *model, double age, double raised, int64_t counter);

/* Go on where the rate of the clock was corrected at the model's last reading: ages before and after it [s]. */
void count_turn(SbCount *count, double age_before, const SbModel *model, double age);

#endif
