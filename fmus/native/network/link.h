/* What the nodes of a CAN network have in common: operations that were heard, one by one; operations and frames that go
   in a tick, after the configuration of the first. Source: FMI-LS-BUS 1.0.0, sections 5.2 and 5.5. */

#ifndef LINK_H
#define LINK_H

#include <string.h>

#include "../bus/bus.h"
#include "../core/ports.h"

/* Codes of operations: u32 code, u32 length of all, arguments; little endian, without padding. */
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

#define TIME_ROUND_OFF 1e-9 /* [s] */

/* An operation that was heard, with its arguments; of a frame its identifier, with the flag of 29 bits, and its data. */
typedef struct {
    uint32_t code, key;
    int is_frame, is_fd, is_remote;
    const uint8_t *arguments, *data;
    size_t length, n; /* of the arguments, of the data */
} Heard;

/* The next operation that was heard, from *at on, which begins at 0. What is none is answered with a Format Error. 0 at
   the end, where all is forgotten. */
int link_next(Link *link, size_t *at, Heard *heard);

/* A tick begins: bit rates and arbitration in the first one, and what is to be replied. 0 if it has begun before. */
int link_tick(Link *link, const NodeSetup *setup);

/* The event ends: what was sealed is gone. */
void link_end_tick(Link *link);

void link_send(Link *link, uint32_t code, const uint8_t *arguments, size_t n);

/* Send a frame that is composed. */
void link_send_frame(Link *link, const SentFrame *frame, const uint8_t *data);

/* The kinds of nodes of the plant's library: the sender of a vehicle's strains, and the bus. */
extern const NodeKind SENDER, CAN_BUS;

#endif
