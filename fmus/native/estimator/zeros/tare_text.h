/* What an FMU says of a tare, one line; gauges go by their number. */

#ifndef TARE_TEXT_H
#define TARE_TEXT_H

#include "tare_state.h"

/* The first of what speaks against the zeros. */
void say_refused(Tare *tare);
void say_taken(Tare *tare);

#endif
