/* The file in resources/: read as a whole, then checked before anything of it is used.

       magic (8) | format version (4) | byte order mark (4) | length (8) | CRC-32 of all from byte 32 on (4) | zero (4) | ..

   The checks go from the outside in, so that the message names the cause: no such file, another byte order, another
   version, cut or extended, damaged. CRC-32 (ISO 3309, polynomial 0xEDB88320 with reflected bits) detects every
   burst up to 32 bits. docs/developers/native.md, "The map file". */

#include "resource.h"

#include <stdio.h>
#include <stdlib.h>

#include "uri_path.h"

#define MAGIC_SIZE 8
#define CHECKED_FROM 32 /* the checksum is over all bytes from here on */
#define BYTE_ORDER_MARK 0x01020304u
#define MAX_FILE ((size_t)1 << 30)

/* Four bytes per round, each through its own table ("slicing"): Kounavis & Berry, ISCC 2005. The tables are made on
   the stack in a few microseconds, so that instances share nothing. */
uint32_t crc32(const unsigned char *bytes, size_t length) {
    uint32_t table[4][256];
    for (uint32_t i = 0; i < 256; i++) {
        uint32_t value = i;
        for (int bit = 0; bit < 8; bit++) {
            value = (value >> 1) ^ (value & 1u ? 0xEDB88320u : 0u);
        }
        table[0][i] = value;
    }
    for (int k = 1; k < 4; k++) {
        for (int i = 0; i < 256; i++) {
            table[k][i] = (table[k - 1][i] >> 8) ^ table[0][table[k - 1][i] & 0xFFu];
        }
    }
    uint32_t crc = 0xFFFFFFFFu;
    size_t position = 0;
    for (; position + 4 <= length; position += 4) {
        crc ^= u32_at(bytes, position);
        crc = table[3][crc & 0xFFu] ^ table[2][(crc >> 8) & 0xFFu] ^ table[1][(crc >> 16) & 0xFFu]
            ^ table[0][crc >> 24];
    }
    for (; position < length; position++) {
        crc = (crc >> 8) ^ table[0][(crc ^ bytes[position]) & 0xFFu];
    }
    return ~crc;
}

int resource_check(const unsigned char *bytes, size_t length, const char *magic, int version, const char *content,
                   char text[MODEL_TEXT_SIZE]) {
    if (length < HEADER_SIZE || memcmp(bytes, magic, MAGIC_SIZE) != 0) {
        snprintf(text, MODEL_TEXT_SIZE, "is no %s of an FMU (%lu bytes)", content, (unsigned long)length);
        return 0;
    }
    if (u32_at(bytes, 12) != BYTE_ORDER_MARK) {
        snprintf(text, MODEL_TEXT_SIZE, "has another byte order than this machine");
        return 0;
    }
    if (u32_at(bytes, 8) != (uint32_t)version) {
        snprintf(text, MODEL_TEXT_SIZE, "has format version %lu, must be %d: export the FMU again",
                 (unsigned long)u32_at(bytes, 8), version);
        return 0;
    }
    uint64_t stated;
    memcpy(&stated, bytes + 16, sizeof stated);
    if (stated != length) {
        snprintf(text, MODEL_TEXT_SIZE, "has %lu bytes, must have %.0f: the file is cut or extended",
                 (unsigned long)length, (double)stated);
        return 0;
    }
    if (u32_at(bytes, CHECKSUM_AT) != crc32(bytes + CHECKED_FROM, length - CHECKED_FROM) || u32_at(bytes, 28) != 0) {
        snprintf(text, MODEL_TEXT_SIZE, "is damaged: its checksum is wrong");
        return 0;
    }
    return 1;
}

int resource_exists(const char *path) {
    FILE *file = open_file(path);
    if (file != NULL) {
        fclose(file);
    }
    return file != NULL;
}

unsigned char *resource_read(const char *path, size_t *length, char text[MODEL_TEXT_SIZE]) {
    FILE *file = open_file(path);
    if (file == NULL) {
        snprintf(text, MODEL_TEXT_SIZE, "cannot be opened");
        return NULL;
    }
    unsigned char *bytes = NULL;
    const long size = fseek(file, 0, SEEK_END) == 0 ? ftell(file) : -1;
    if (size >= 0 && (size_t)size <= MAX_FILE && fseek(file, 0, SEEK_SET) == 0) {
        *length = (size_t)size;
        bytes = malloc(*length + 1); /* never of size 0 */
        if (bytes != NULL && fread(bytes, 1, *length, file) != *length) {
            free(bytes);
            bytes = NULL;
        }
    }
    fclose(file);
    if (bytes == NULL) {
        snprintf(text, MODEL_TEXT_SIZE, "cannot be read");
    }
    return bytes;
}
