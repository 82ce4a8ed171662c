#include "seen_frames.h"

/* Remainders of CRC-32 (ISO-HDLC) of four bits. */
static const uint32_t REMAINDER[16] = {0x00000000, 0x1DB71064, 0x3B6E20C8, 0x26D930AC, 0x76DC4190, 0x6B6B51F4,
                                       0x4DB26158, 0x5005713C, 0xEDB88320, 0xF00F9344, 0xD6D6A3E8, 0xCB61B38C,
                                       0x9B64C2B0, 0x86D3D2D4, 0xA00AE278, 0xBDBDF21C};

static uint32_t crc_32(uint32_t crc, const uint8_t *data, int64_t count) {
    for (int64_t k = 0; k < count; k++) {
        crc ^= data[k];
        crc = crc >> 4 ^ REMAINDER[crc & 15];
        crc = crc >> 4 ^ REMAINDER[crc & 15];
    }
    return crc;
}

int64_t seen_add(uint64_t *words, const uint8_t *prefix, const uint8_t *data, int64_t count) {
    const uint32_t begin = prefix == NULL ? 0xFFFFFFFF : crc_32(0xFFFFFFFF, prefix, SEEN_PREFIX);
    const uint32_t mixed = ~crc_32(begin, data, count);
    const uint64_t own = UINT64_C(1) << (mixed & 63) | UINT64_C(1) << (mixed >> 6 & 63);
    uint64_t *word = &words[mixed >> 12];
    const int64_t is_new = (*word & own) != own;
    *word |= own;
    return is_new;
}

int64_t sb_seen_add(uint64_t *words, const uint8_t *data, int count) {
    return seen_add(words, NULL, data, count);
}
