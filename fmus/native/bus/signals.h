/* What the bytes of a frame hold: counter, check sum, and signals one by one. */

#ifndef SIGNALS_H
#define SIGNALS_H

#include <math.h>
#include <string.h>

#include "bus.h"

static inline uint16_t frame_crc_in(const SbSlot *slot, const uint8_t *data) {
    return slot->profile == 1 ? data[0] : (uint16_t)(data[0] | data[1] << 8);
}

static inline int frame_counter(const SbSlot *slot, const uint8_t *data) {
    return slot->profile == 1 ? data[1] & 0x0F : data[2];
}

/* The raw number of a signal. Nine bytes hold one of 64 bits that does not begin with a byte. */
static inline int64_t signal_raw(const SbSignal *s, const uint8_t *data) {
    const uint8_t *first = data + s->byte, *last = first + s->count - 1, *byte = s->is_big ? first : last;
    const uint64_t sign = s->kind == SB_SIGNED ? UINT64_C(1) << (s->length - 1) : 0;
    uint64_t number = 0;
    for (int k = 0; k < s->count; k++, byte += s->is_big ? 1 : -1) {
        number = number << 8 | *byte;
    }
    number = number >> s->shift | (s->count < 9 ? 0 : (uint64_t)(s->is_big ? *first : *last) << (64 - s->shift));
    return (int64_t)(((number & UINT64_MAX >> (64 - s->length)) ^ sign) - sign);
}

/* A float of 16 bits: 10 of its fraction, 5 of its exponent. */
static inline double half_float(uint64_t bits) {
    const uint64_t fraction = bits & 0x3FF, exponent = bits >> 10 & 0x1F;
    double value;
    if (exponent == 31) {
        value = fraction ? NAN : INFINITY;
    } else if (exponent == 0) {
        value = (double)fraction * 0x1p-24;
    } else {
        const uint64_t wide = (exponent + 1008) << 52 | fraction << 42;
        memcpy(&value, &wide, sizeof value);
    }
    return bits >> 15 & 1 ? -value : value;
}

static inline double float_value(uint64_t bits, int length) {
    if (length == 16) {
        return half_float(bits);
    }
    if (length == 32) {
        const uint32_t narrow = (uint32_t)bits;
        float value;
        memcpy(&value, &narrow, sizeof value);
        return value;
    }
    double value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

static inline double signal_value(const SbSignal *s, int64_t raw) {
    double number = (double)raw;
    if (s->kind == SB_FLOAT) {
        number = float_value((uint64_t)raw, s->length);
    } else if (s->kind == SB_UNSIGNED && s->length == 64) {
        number = (double)(uint64_t)raw;
    }
    return number * s->scale + s->offset;
}

/* Whether a raw number stands for "no value". */
static inline int signal_is_code(const SbPlan *p, const SbSignal *s, int64_t raw) {
    for (int k = 0; k < s->n_codes; k++) {
        if (raw == p->code[s->first_code + k]) {
            return 1;
        }
    }
    return 0;
}

/* Whether a value is beyond the signal's limits, or at a converter's end: it is overdriven, or its wire is broken. */
static inline int signal_is_outside(const SbSignal *s, int64_t raw, double value) {
    const int is_end = s->has_ends && (raw == s->first || raw == s->last);
    return is_end || !(value >= s->low && value <= s->high);
}

#endif
