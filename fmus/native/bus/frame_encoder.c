#include <math.h>
#include <string.h>

#include "frame_crc.h"
#include "rounding.h"

/* 2^k for 0 <= k <= 64. */
static double power_of_two(int64_t k) {
    return k < 64 ? (double)((uint64_t)1 << k) : 0x1p64;
}

/* Bits of a float of 16 bits next to x, half to even; |x| is at most the largest, 65504. */
static uint64_t half_bits(double x) {
    const uint64_t sign = signbit(x) ? 0x8000 : 0;
    const double size = x < 0.0 ? -x : x;
    if (size < 0x1p-14) { /* what rounds up to it is the next one's bits */
        return sign | (uint64_t)nearest(size * 0x1p24);
    }
    uint64_t wide;
    memcpy(&wide, &size, sizeof wide);
    const uint64_t exponent = wide >> 52; /* 1009 to 1038 */
    wide &= ((uint64_t)1 << 52) - 1;
    const double fraction = nearest((double)wide * 0x1p-42);
    return sign | ((exponent - 1008) * 1024 + (uint64_t)fraction);
}

/* Bits of a float next to x; of what is no number, the bits of the usual one. */
static uint64_t float_bits(double x, int64_t length) {
    const int is_number = x == x;
    if (length == 16) {
        return is_number ? half_bits(x) : 0x7E00;
    }
    if (length == 32) {
        const float narrow = (float)x;
        uint32_t bits;
        memcpy(&bits, &narrow, sizeof bits);
        return is_number ? bits : 0x7FC00000;
    }
    uint64_t bits;
    memcpy(&bits, &x, sizeof bits);
    return is_number ? bits : (uint64_t)0x7FF8 << 48;
}

static double largest_float(int64_t length) {
    return length == 16 ? 65504.0 : length == 32 ? 0x1.FFFFFEp127 : 0x1.FFFFFFFFFFFFFp1023;
}

/* Raw number of signal i for a value; 0 if the signal cannot hold it and has nothing for "not available". */
static int raw_of(const SbEncoder *e, int64_t i, double value, uint64_t *raw) {
    const double scaled = (value - e->offset[i]) / e->scale[i];
    const int is_allowed = value >= e->low[i] && value <= e->high[i];
    if (e->kind[i] == SB_FLOAT) {
        const double most = largest_float(e->length[i]);
        *raw = float_bits(is_allowed && scaled >= -most && scaled <= most ? scaled : NAN, e->length[i]);
        return 1;
    }
    const int is_signed = e->kind[i] == SB_SIGNED;
    const double beyond = power_of_two(e->length[i] - is_signed), least = is_signed ? -beyond : 0.0;
    const double number = scaled < 0.0 ? -nearest(-scaled) : nearest(scaled);
    if (is_allowed && number >= least && number < beyond) {
        *raw = number < 0.0 ? (uint64_t)(int64_t)number : (uint64_t)number;
        return 1;
    }
    *raw = (uint64_t)e->none[i];
    return e->has_none[i] != 0;
}

/* Write a number of `length` bits over zeros, `shift` bits above the lowest of its bytes. */
static void put_bits(uint8_t *data, const SbEncoder *e, int64_t i, uint64_t number) {
    const int64_t count = e->count[i], shift = e->shift[i], unused = 64 - e->length[i];
    number = number << unused >> unused;
    for (int64_t k = 0; k < count; k++) {
        const uint64_t bits = k == 0 ? number << shift : number >> (8 * k - shift);
        data[e->byte[i] + (e->is_big[i] ? count - 1 - k : k)] |= (uint8_t)bits;
    }
}

int64_t sb_encode(const SbEncoder *encoder, const double *value, int counter, uint8_t *data) {
    const SbEncoder *e = encoder;
    memset(data, 0, (size_t)e->n_bytes);
    for (int64_t i = 0; i < e->n; i++) {
        uint64_t raw;
        if (!raw_of(e, i, value[i], &raw)) {
            return i;
        }
        put_bits(data, e, i, raw);
    }
    if (counter < 0) {
        return -1;
    }
    if (e->profile == 1) {
        data[1] = (uint8_t)((data[1] & 0xF0) | counter);
        data[0] = (uint8_t)frame_crc(1, e->data_id, e->end, data, e->n_bytes, NULL, 0);
    } else if (e->profile) {
        data[2] = (uint8_t)counter;
        const uint16_t crc = frame_crc(e->profile, e->data_id, e->end, data, e->n_bytes, NULL, 0);
        data[0] = (uint8_t)crc;
        data[1] = (uint8_t)(crc >> 8);
    }
    return -1;
}
