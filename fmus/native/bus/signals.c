/* Signals and check sums of frames.

   Decoding: value = raw * scale + offset; encoding: raw = nearest((value - offset) / scale), half to even.
   Profile 5: CRC-16/CCITT-FALSE over what follows the CRC, then the DataID, low byte first; in bytes 0 and 1, low byte
   first; counter in byte 2. Profile 1: CRC-8/SAE-J1850, start and final XOR 0, over DataID low, DataID high and what follows
   the CRC; in byte 0; counter in the low nibble of byte 1. Source: AUTOSAR PRS_E2EProtocol (document 849). */

#include <math.h>
#include <string.h>

#include "bus.h"
#include "rounding.h"

/* Remainders of a byte of CRC-16/CCITT-FALSE and CRC-8/SAE-J1850. */
static const uint16_t REMAINDER_16[256] = {
    0x0000, 0x1021, 0x2042, 0x3063, 0x4084, 0x50A5, 0x60C6, 0x70E7, 0x8108, 0x9129, 0xA14A, 0xB16B, 0xC18C,
    0xD1AD, 0xE1CE, 0xF1EF, 0x1231, 0x0210, 0x3273, 0x2252, 0x52B5, 0x4294, 0x72F7, 0x62D6, 0x9339, 0x8318,
    0xB37B, 0xA35A, 0xD3BD, 0xC39C, 0xF3FF, 0xE3DE, 0x2462, 0x3443, 0x0420, 0x1401, 0x64E6, 0x74C7, 0x44A4,
    0x5485, 0xA56A, 0xB54B, 0x8528, 0x9509, 0xE5EE, 0xF5CF, 0xC5AC, 0xD58D, 0x3653, 0x2672, 0x1611, 0x0630,
    0x76D7, 0x66F6, 0x5695, 0x46B4, 0xB75B, 0xA77A, 0x9719, 0x8738, 0xF7DF, 0xE7FE, 0xD79D, 0xC7BC, 0x48C4,
    0x58E5, 0x6886, 0x78A7, 0x0840, 0x1861, 0x2802, 0x3823, 0xC9CC, 0xD9ED, 0xE98E, 0xF9AF, 0x8948, 0x9969,
    0xA90A, 0xB92B, 0x5AF5, 0x4AD4, 0x7AB7, 0x6A96, 0x1A71, 0x0A50, 0x3A33, 0x2A12, 0xDBFD, 0xCBDC, 0xFBBF,
    0xEB9E, 0x9B79, 0x8B58, 0xBB3B, 0xAB1A, 0x6CA6, 0x7C87, 0x4CE4, 0x5CC5, 0x2C22, 0x3C03, 0x0C60, 0x1C41,
    0xEDAE, 0xFD8F, 0xCDEC, 0xDDCD, 0xAD2A, 0xBD0B, 0x8D68, 0x9D49, 0x7E97, 0x6EB6, 0x5ED5, 0x4EF4, 0x3E13,
    0x2E32, 0x1E51, 0x0E70, 0xFF9F, 0xEFBE, 0xDFDD, 0xCFFC, 0xBF1B, 0xAF3A, 0x9F59, 0x8F78, 0x9188, 0x81A9,
    0xB1CA, 0xA1EB, 0xD10C, 0xC12D, 0xF14E, 0xE16F, 0x1080, 0x00A1, 0x30C2, 0x20E3, 0x5004, 0x4025, 0x7046,
    0x6067, 0x83B9, 0x9398, 0xA3FB, 0xB3DA, 0xC33D, 0xD31C, 0xE37F, 0xF35E, 0x02B1, 0x1290, 0x22F3, 0x32D2,
    0x4235, 0x5214, 0x6277, 0x7256, 0xB5EA, 0xA5CB, 0x95A8, 0x8589, 0xF56E, 0xE54F, 0xD52C, 0xC50D, 0x34E2,
    0x24C3, 0x14A0, 0x0481, 0x7466, 0x6447, 0x5424, 0x4405, 0xA7DB, 0xB7FA, 0x8799, 0x97B8, 0xE75F, 0xF77E,
    0xC71D, 0xD73C, 0x26D3, 0x36F2, 0x0691, 0x16B0, 0x6657, 0x7676, 0x4615, 0x5634, 0xD94C, 0xC96D, 0xF90E,
    0xE92F, 0x99C8, 0x89E9, 0xB98A, 0xA9AB, 0x5844, 0x4865, 0x7806, 0x6827, 0x18C0, 0x08E1, 0x3882, 0x28A3,
    0xCB7D, 0xDB5C, 0xEB3F, 0xFB1E, 0x8BF9, 0x9BD8, 0xABBB, 0xBB9A, 0x4A75, 0x5A54, 0x6A37, 0x7A16, 0x0AF1,
    0x1AD0, 0x2AB3, 0x3A92, 0xFD2E, 0xED0F, 0xDD6C, 0xCD4D, 0xBDAA, 0xAD8B, 0x9DE8, 0x8DC9, 0x7C26, 0x6C07,
    0x5C64, 0x4C45, 0x3CA2, 0x2C83, 0x1CE0, 0x0CC1, 0xEF1F, 0xFF3E, 0xCF5D, 0xDF7C, 0xAF9B, 0xBFBA, 0x8FD9,
    0x9FF8, 0x6E17, 0x7E36, 0x4E55, 0x5E74, 0x2E93, 0x3EB2, 0x0ED1, 0x1EF0,
};
static const uint8_t REMAINDER_8[256] = {
    0x00, 0x1D, 0x3A, 0x27, 0x74, 0x69, 0x4E, 0x53, 0xE8, 0xF5, 0xD2, 0xCF, 0x9C, 0x81, 0xA6, 0xBB, 0xCD, 0xD0,
    0xF7, 0xEA, 0xB9, 0xA4, 0x83, 0x9E, 0x25, 0x38, 0x1F, 0x02, 0x51, 0x4C, 0x6B, 0x76, 0x87, 0x9A, 0xBD, 0xA0,
    0xF3, 0xEE, 0xC9, 0xD4, 0x6F, 0x72, 0x55, 0x48, 0x1B, 0x06, 0x21, 0x3C, 0x4A, 0x57, 0x70, 0x6D, 0x3E, 0x23,
    0x04, 0x19, 0xA2, 0xBF, 0x98, 0x85, 0xD6, 0xCB, 0xEC, 0xF1, 0x13, 0x0E, 0x29, 0x34, 0x67, 0x7A, 0x5D, 0x40,
    0xFB, 0xE6, 0xC1, 0xDC, 0x8F, 0x92, 0xB5, 0xA8, 0xDE, 0xC3, 0xE4, 0xF9, 0xAA, 0xB7, 0x90, 0x8D, 0x36, 0x2B,
    0x0C, 0x11, 0x42, 0x5F, 0x78, 0x65, 0x94, 0x89, 0xAE, 0xB3, 0xE0, 0xFD, 0xDA, 0xC7, 0x7C, 0x61, 0x46, 0x5B,
    0x08, 0x15, 0x32, 0x2F, 0x59, 0x44, 0x63, 0x7E, 0x2D, 0x30, 0x17, 0x0A, 0xB1, 0xAC, 0x8B, 0x96, 0xC5, 0xD8,
    0xFF, 0xE2, 0x26, 0x3B, 0x1C, 0x01, 0x52, 0x4F, 0x68, 0x75, 0xCE, 0xD3, 0xF4, 0xE9, 0xBA, 0xA7, 0x80, 0x9D,
    0xEB, 0xF6, 0xD1, 0xCC, 0x9F, 0x82, 0xA5, 0xB8, 0x03, 0x1E, 0x39, 0x24, 0x77, 0x6A, 0x4D, 0x50, 0xA1, 0xBC,
    0x9B, 0x86, 0xD5, 0xC8, 0xEF, 0xF2, 0x49, 0x54, 0x73, 0x6E, 0x3D, 0x20, 0x07, 0x1A, 0x6C, 0x71, 0x56, 0x4B,
    0x18, 0x05, 0x22, 0x3F, 0x84, 0x99, 0xBE, 0xA3, 0xF0, 0xED, 0xCA, 0xD7, 0x35, 0x28, 0x0F, 0x12, 0x41, 0x5C,
    0x7B, 0x66, 0xDD, 0xC0, 0xE7, 0xFA, 0xA9, 0xB4, 0x93, 0x8E, 0xF8, 0xE5, 0xC2, 0xDF, 0x8C, 0x91, 0xB6, 0xAB,
    0x10, 0x0D, 0x2A, 0x37, 0x64, 0x79, 0x5E, 0x43, 0xB2, 0xAF, 0x88, 0x95, 0xC6, 0xDB, 0xFC, 0xE1, 0x5A, 0x47,
    0x60, 0x7D, 0x2E, 0x33, 0x14, 0x09, 0x7F, 0x62, 0x45, 0x58, 0x0B, 0x16, 0x31, 0x2C, 0x97, 0x8A, 0xAD, 0xB0,
    0xE3, 0xFE, 0xD9, 0xC4,
};

static uint16_t crc_16(uint16_t crc, const uint8_t *data, int count) {
    for (int k = 0; k < count; k++) {
        crc = (uint16_t)(crc << 8) ^ REMAINDER_16[crc >> 8 ^ data[k]];
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

uint16_t frame_crc_in(const SbSlot *slot, const uint8_t *data) {
    return slot->profile == 1 ? data[0] : (uint16_t)(data[0] | data[1] << 8);
}

int frame_counter(const SbSlot *slot, const uint8_t *data) {
    return slot->profile == 1 ? data[1] & 0x0F : data[2];
}

/* The number in `count` bytes, of which the lowest `shift` bits are left out. Nine bytes hold one of 64 bits that does
   not begin with a byte. */
static uint64_t bits_of(const uint8_t *data, int count, int shift, int is_big) {
    uint64_t low = 0;
    const int whole = count < 9 ? count : 8;
    for (int k = 0; k < whole; k++) {
        low |= (uint64_t)data[is_big ? count - 1 - k : k] << (8 * k);
    }
    low >>= shift;
    return count < 9 ? low : low | (uint64_t)data[is_big ? 0 : 8] << (64 - shift);
}

int64_t signal_raw(const SbSignal *s, const uint8_t *data) {
    const int unused = 64 - s->length;
    const uint64_t number = bits_of(data + s->byte, s->count, s->shift, s->is_big != 0) << unused;
    if (s->kind != SB_SIGNED || !(number >> 63)) {
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

static double float_value(uint64_t bits, int length) {
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

double signal_value(const SbSignal *s, int64_t raw) {
    double number = (double)raw;
    if (s->kind == SB_FLOAT) {
        number = float_value((uint64_t)raw, s->length);
    } else if (s->kind == SB_UNSIGNED && s->length == 64) {
        number = (double)(uint64_t)raw;
    }
    return number * s->scale + s->offset;
}

/* Whether a raw number stands for "no value". */
int signal_is_code(const SbPlan *p, const SbSignal *s, int64_t raw) {
    for (int k = 0; k < s->n_codes; k++) {
        if (raw == p->code[s->first_code + k]) {
            return 1;
        }
    }
    return 0;
}

/* Whether a value is beyond the signal's limits, or at a converter's end: it is overdriven, or its wire is broken. */
int signal_is_outside(const SbSignal *s, int64_t raw, double value) {
    const int is_end = s->has_ends && (raw == s->first || raw == s->last);
    return is_end || !(value >= s->low && value <= s->high);
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

/* 2^k for 0 <= k <= 64. */
static double power_of_two(int k) {
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
    for (int k = 0; k < s->count; k++) {
        const uint64_t bits = k == 0 ? number << s->shift : number >> (8 * k - s->shift);
        data[s->byte + (s->is_big ? s->count - 1 - k : k)] |= (uint8_t)bits;
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
