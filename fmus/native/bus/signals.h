/* One signal of a decoder: its raw number, its value, and whether that may be used. */

#ifndef SIGNALS_H
#define SIGNALS_H

#include "strainbus.h"

/* Raw number of signal `i` in the bytes of all frames, sign extended; of a float its bit pattern. */
int64_t signal_raw(const SbDecoder *decoder, int64_t i, const uint8_t *data);

/* Value of a raw number in the signal's unit. */
double signal_value(const SbDecoder *decoder, int64_t i, int64_t raw);

/* Whether a raw number stands for "no value". */
int signal_is_code(const SbDecoder *decoder, int64_t i, int64_t raw);

/* Whether a value is beyond the signal's limits, or at a converter's end: it is overdriven, or its wire is broken. */
int signal_is_outside(const SbDecoder *decoder, int64_t i, int64_t raw, double value);

#endif
