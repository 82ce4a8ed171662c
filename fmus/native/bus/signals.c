/* Signals and check sums of frames.

   Decoding: value = raw * scale + offset; encoding: raw = nearest((value - offset) / scale), half to even.
   Profile 5: CRC-16/CCITT-FALSE over what follows the CRC, then the DataID, low byte first; in bytes 0 and 1, low byte
   first; counter in byte 2. Profile 1: CRC-8/SAE-J1850, start and final XOR 0, over DataID low, DataID high and what follows
   the CRC; in byte 0; counter in the low nibble of byte 1. Source: AUTOSAR PRS_E2EProtocol (document 849). */

#include <math.h>
#include <string.h>

#include "bus.h"
#include "rounding.h"
#include "signals.h"

/* A table by its byte, of a function that is linear in the bits. */
#define OF_BITS(n, a, b, c, d, e, f, g, h)                                                                 \
    ((n) & 1 ? a : 0) ^ ((n) & 2 ? b : 0) ^ ((n) & 4 ? c : 0) ^ ((n) & 8 ? d : 0) ^ ((n) & 16 ? e : 0) ^ \
        ((n) & 32 ? f : 0) ^ ((n) & 64 ? g : 0) ^ ((n) & 128 ? h : 0)
#define FOUR(of, n) of(n), of(n + 1), of(n + 2), of(n + 3)
#define SIXTEEN(of, n) FOUR(of, n), FOUR(of, n + 4), FOUR(of, n + 8), FOUR(of, n + 12)
#define SIXTY_FOUR(of, n) SIXTEEN(of, n), SIXTEEN(of, n + 16), SIXTEEN(of, n + 32), SIXTEEN(of, n + 48)
#define BYTES(of) {SIXTY_FOUR(of, 0), SIXTY_FOUR(of, 64), SIXTY_FOUR(of, 128), SIXTY_FOUR(of, 192)}

/* Remainders of CRC-16/CCITT-FALSE of a byte ahead of 0 to 3 others, and of CRC-8/SAE-J1850 of a byte. */
#define AHEAD_0(n) OF_BITS(n, 0x1021, 0x2042, 0x4084, 0x8108, 0x1231, 0x2462, 0x48C4, 0x9188)
#define AHEAD_1(n) OF_BITS(n, 0x3331, 0x6662, 0xCCC4, 0x89A9, 0x0373, 0x06E6, 0x0DCC, 0x1B98)
#define AHEAD_2(n) OF_BITS(n, 0x3730, 0x6E60, 0xDCC0, 0xA9A1, 0x4363, 0x86C6, 0x1DAD, 0x3B5A)
#define AHEAD_3(n) OF_BITS(n, 0x76B4, 0xED68, 0xCAF1, 0x85C3, 0x1BA7, 0x374E, 0x6E9C, 0xDD38)
#define OF_CRC_8(n) OF_BITS(n, 0x1D, 0x3A, 0x74, 0xE8, 0xCD, 0x87, 0x13, 0x26)
static const uint16_t REMAINDER_16[4][256] = {BYTES(AHEAD_0), BYTES(AHEAD_1), BYTES(AHEAD_2), BYTES(AHEAD_3)};
static const uint8_t REMAINDER_8[256] = BYTES(OF_CRC_8);

static uint16_t crc_16(uint16_t crc, const uint8_t *data, int count) {
    for (; count >= 4; count -= 4, data += 4) {
        crc = REMAINDER_16[3][crc >> 8 ^ data[0]] ^ REMAINDER_16[2][(crc & 0xFF) ^ data[1]] ^ REMAINDER_16[1][data[2]] ^
              REMAINDER_16[0][data[3]];
    }
    for (int k = 0; k < count; k++) {
        crc = (uint16_t)(crc << 8) ^ REMAINDER_16[0][crc >> 8 ^ data[k]];
    }
    return crc;
}

static uint8_t crc_8(uint8_t crc, const uint8_t *data, int count) {
    for (int k = 0; k < count; k++) {
        crc = REMAINDER_8[crc ^ data[k]];
    }
    return crc;
}

/* CRC of a frame and of `covered`, bytes of other frames behind it. */
uint16_t frame_crc(const SbSlot *slot, const uint8_t *data, int n, const uint8_t *covered, int n_covered) {
    const uint8_t id[2] = {(uint8_t)slot->data_id, (uint8_t)(slot->data_id >> 8)};
    const int end = slot->crc_end >= 0 && slot->crc_end < n ? slot->crc_end : n;
    if (slot->profile == 1) {
        const uint8_t crc = crc_8(crc_8(0, id, 2), data + 1, end - 1);
        return crc_8(crc, covered, n_covered);
    }
    const uint16_t crc = crc_16(crc_16(0xFFFF, data + 2, end - 2), covered, n_covered);
    return crc_16(crc, id, 2);
}

void sb_raw(const SbSignal *signal, int count, const uint8_t *data, int64_t *raw) {
    for (int i = 0; i < count; i++) {
        raw[i] = signal_raw(&signal[i], data);
    }
}

void sb_physical(const SbSignal *signal, int count, const int64_t *raw, double *value) {
    for (int i = 0; i < count; i++) {
        value[i] = signal_value(&signal[i], raw[i]);
    }
}

/* --- encoding ------------------------------------------------------------------------------------------------------- */

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
static uint64_t float_bits(double x, int length) {
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

static double largest_float(int length) {
    return length == 16 ? 65504.0 : length == 32 ? 0x1.FFFFFEp127 : 0x1.FFFFFFFFFFFFFp1023;
}

/* Raw number of a value; 0 if the signal cannot hold it and has nothing for "not available". */
static int raw_of(const SbSignal *s, double value, uint64_t *raw) {
    const double scaled = (value - s->offset) / s->scale;
    const int is_allowed = value >= s->low && value <= s->high;
    if (s->kind == SB_FLOAT) {
        const double most = largest_float(s->length);
        *raw = float_bits(is_allowed && scaled >= -most && scaled <= most ? scaled : NAN, s->length);
        return 1;
    }
    const int is_signed = s->kind == SB_SIGNED;
    const double beyond = power_of_two(s->length - is_signed), least = is_signed ? -beyond : 0.0;
    const double number = scaled < 0.0 ? -nearest(-scaled) : nearest(scaled);
    if (is_allowed && number >= least && number < beyond) {
        *raw = number < 0.0 ? (uint64_t)(int64_t)number : (uint64_t)number;
        return 1;
    }
    *raw = (uint64_t)s->none;
    return s->has_none != 0;
}

/* Write a number over zeros, `shift` bits above the lowest of its bytes. */
static void put_bits(uint8_t *data, const SbSignal *s, uint64_t number) {
    const int unused = 64 - s->length;
    number = number << unused >> unused;
    const uint64_t low = number << s->shift;
    for (int k = 0; k < s->count; k++) {
        data[s->byte + (s->is_big ? s->count - 1 - k : k)] |= (uint8_t)(k < 8 ? low >> 8 * k : number >> (64 - s->shift));
    }
}

int sb_encode(const SbSignal *signal, int count, const double *value, int counter, const SbSlot *protection,
              uint8_t *data, int n_bytes) {
    memset(data, 0, (size_t)n_bytes);
    for (int i = 0; i < count; i++) {
        uint64_t raw;
        if (!raw_of(&signal[i], value[i], &raw)) {
            return i;
        }
        put_bits(data, &signal[i], raw);
    }
    if (counter < 0) {
        return -1;
    }
    if (protection->profile == 1) {
        data[1] = (uint8_t)((data[1] & 0xF0) | counter);
        data[0] = (uint8_t)frame_crc(protection, data, n_bytes, NULL, 0);
    } else if (protection->profile) {
        data[2] = (uint8_t)counter;
        const uint16_t crc = frame_crc(protection, data, n_bytes, NULL, 0);
        data[0] = (uint8_t)crc;
        data[1] = (uint8_t)(crc >> 8);
    }
    return -1;
}
