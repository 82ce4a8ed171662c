/* Operations of FMI-LS-BUS 1.0 on a CAN bus: u32 code, u32 length of all, arguments; little endian, without padding.
   Source: FMI-LS-BUS 1.0.0, sections 5.2 and 5.5.1.2. */

#ifndef OPERATIONS_H
#define OPERATIONS_H

#include <stddef.h>
#include <stdint.h>
#include <string.h>

enum {
    FORMAT_ERROR = 0x01,
    CAN_TRANSMIT = 0x10,    /* u32 identifier, u8 extended, u8 remote, u16 n, data */
    CAN_FD_TRANSMIT = 0x11, /* u32 identifier, u8 extended, u8 bit rate switch, u8 error state, u16 n, data */
    CAN_XL_TRANSMIT = 0x12,
    CONFIRM = 0x20,
    ARBITRATION_LOST = 0x30,
    BUS_ERROR = 0x31,
    CONFIGURATION_OF_BUS = 0x40, /* u8 what, then its value */
    STATUS_OF_NODE = 0x41,
    WAKE_UP = 0x42
};

enum { OPERATION_HEAD = 8, CAN_HEAD = 8, CAN_FD_HEAD = 9, LONGEST_ECHO = 256 };

/* What the operation of a configuration states. */
enum { CAN_RATE = 1, CAN_FD_RATE = 2, ARBITRATION = 4 };

enum { BUFFER_AND_RETRANSMIT = 1 };

static inline void put_number(uint8_t *to, uint64_t value, int bytes) {
    for (int i = 0; i < bytes; i++) {
        to[i] = (uint8_t)(value >> 8 * i);
    }
}

static inline uint64_t get_number(const uint8_t *from, int bytes) {
    uint64_t value = 0;
    for (int i = 0; i < bytes; i++) {
        value |= (uint64_t)from[i] << 8 * i;
    }
    return value;
}

/* Append an operation to *n bytes of at most `most`; 0 without a place for it. */
static inline int append_operation(uint8_t *to, size_t *n, size_t most, uint32_t code, const uint8_t *arguments,
                                   size_t length) {
    if (length + OPERATION_HEAD > most - *n) {
        return 0;
    }
    put_number(to + *n, code, 4);
    put_number(to + *n + 4, OPERATION_HEAD + length, 4);
    memcpy(to + *n + OPERATION_HEAD, arguments, length);
    *n += OPERATION_HEAD + length;
    return 1;
}

/* The operation at *at of n bytes: 1, and *at is behind it; 0 at the end, or where the rest is none. */
static inline int next_operation(const uint8_t *bytes, size_t n, size_t *at, uint32_t *code, const uint8_t **arguments,
                                 size_t *length) {
    if (n - *at < OPERATION_HEAD) {
        return 0;
    }
    const uint64_t whole = get_number(bytes + *at + 4, 4);
    if (whole < OPERATION_HEAD || whole > n - *at) {
        return 0;
    }
    *code = (uint32_t)get_number(bytes + *at, 4);
    *arguments = bytes + *at + OPERATION_HEAD;
    *length = (size_t)whole - OPERATION_HEAD;
    *at += (size_t)whole;
    return 1;
}

#endif
