#include <math.h>
#include <string.h>

#include "signals.h"

/* The number in `count` bytes, of which the lowest `shift` bits are left out. Nine bytes hold one of 64 bits that does
   not begin with a byte. */
static uint64_t bits_of(const uint8_t *data, int64_t count, int64_t shift, int is_big) {
    uint64_t low = 0;
    const int64_t whole = count < 9 ? count : 8;
    for (int64_t k = 0; k < whole; k++) {
        low |= (uint64_t)data[is_big ? count - 1 - k : k] << (8 * k);
    }
    low >>= shift;
    return count < 9 ? low : low | (uint64_t)data[is_big ? 0 : 8] << (64 - shift);
}

int64_t signal_raw(const SbDecoder *d, int64_t i, const uint8_t *data) {
    const int64_t unused = 64 - d->length[i];
    const uint64_t number = bits_of(data + d->byte[i], d->count[i], d->shift[i], d->is_big[i] != 0) << unused;
    if (d->kind[i] != SB_SIGNED || !(number >> 63)) {
        return (int64_t)(number >> unused);
    }
    return (int64_t)~(~number >> unused);
}

/* A float of 16 bits: 10 of its fraction, 5 of its exponent. */
static double half_float(uint64_t bits) {
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

static double float_value(uint64_t bits, int64_t length) {
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

double signal_value(const SbDecoder *d, int64_t i, int64_t raw) {
    double number = (double)raw;
    if (d->kind[i] == SB_FLOAT) {
        number = float_value((uint64_t)raw, d->length[i]);
    } else if (d->kind[i] == SB_UNSIGNED && d->length[i] == 64) {
        number = (double)(uint64_t)raw;
    }
    return number * d->scale[i] + d->offset[i];
}

int signal_is_code(const SbDecoder *d, int64_t i, int64_t raw) {
    for (int64_t k = d->first_code[i]; k < d->first_code[i + 1]; k++) {
        if (raw == d->code[k]) {
            return 1;
        }
    }
    return 0;
}

int signal_is_outside(const SbDecoder *d, int64_t i, int64_t raw, double value) {
    const int is_end = d->has_ends[i] && (raw == d->first[i] || raw == d->last[i]);
    return is_end || !(value >= d->low[i] && value <= d->high[i]);
}

static int is_refused(const SbDecoder *d, int64_t i, int64_t raw, double value) {
    return signal_is_code(d, i, raw) || signal_is_outside(d, i, raw, value);
}

void sb_raw(const SbDecoder *decoder, const uint8_t *data, int64_t *raw) {
    for (int64_t i = 0; i < decoder->n; i++) {
        raw[i] = signal_raw(decoder, i, data);
    }
}

void sb_physical(const SbDecoder *decoder, const int64_t *raw, double *value) {
    for (int64_t i = 0; i < decoder->n; i++) {
        value[i] = signal_value(decoder, i, raw[i]);
    }
}

void sb_decode(const SbDecoder *decoder, const uint8_t *data, const uint8_t *here, int refuse_all, SbCycle *cycle) {
    const SbDecoder *d = decoder;
    for (int64_t i = 0; i < d->n; i++) {
        const int64_t raw = signal_raw(d, i, data);
        const double value = signal_value(d, i, raw);
        const uint8_t present = here[d->frame[i]];
        cycle->raw[i] = raw;
        cycle->strain[i] = present ? value * d->to_strain[i] : NAN;
        cycle->present[i] = present;
        cycle->refused[i] = present && (refuse_all || is_refused(d, i, raw, value));
    }
}
