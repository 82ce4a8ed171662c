/* The file in resources/ that holds the data of an FMU: its header, how it is read and checked. */

#ifndef RESOURCE_H
#define RESOURCE_H

#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include "model.h"

#define HEADER_SIZE 128
#define CHECKSUM_AT 24 /* position of the checksum in the header */

/* Read a whole file. Return its bytes, to be freed with free(), or NULL with a text that states what is wrong. */
int resource_exists(const char *path);

unsigned char *resource_read(const char *path, size_t *length, char text[MODEL_TEXT_SIZE]);

/* Whether the first 32 bytes are as in a file of `length` bytes that starts with the 8 bytes of magic; if not, text
   states what is wrong with it. content is what the text calls it. */
int resource_check(const unsigned char *bytes, size_t length, const char *magic, int version, const char *content,
                   char text[MODEL_TEXT_SIZE]);

/* The little-endian number at a position of a file. */
static inline uint32_t u32_at(const unsigned char *bytes, size_t position) {
    uint32_t value;
    memcpy(&value, bytes + position, sizeof value);
    return value;
}

/* Float64 `k` of bytes at any address, and whether it is 0 or 1. */
static inline double double_at(const unsigned char *bytes, size_t k) {
    double value;
    memcpy(&value, bytes + k * sizeof value, sizeof value);
    return value;
}

static inline int is_flag(double value) {
    return value == 0.0 || value == 1.0;
}

/* CRC-32 of ISO 3309, as in zlib. */
uint32_t crc32(const unsigned char *bytes, size_t length);

#endif
