/* What the nodes of a CAN network have in common: operations that were heard, one by one; operations and frames that go
   in a tick, after the configuration of the first. Source: FMI-LS-BUS 1.0.0, sections 5.2 and 5.5. */

#ifndef LINK_H
#define LINK_H

#include "../bus/bus.h"
#include "../core/ports.h"
#include "operations.h"

#define EXTENDED_FLAG 0x80000000u
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

/* A tick begins: bit rates [bit/s, 0 for none] and arbitration in the first one, and what is to be replied. 0 if it has
   begun before. */
int link_tick(Link *link, int32_t can_rate, int32_t fd_rate);

/* The event ends: what was sealed is gone. */
void link_end_tick(Link *link);

void link_send(Link *link, uint32_t code, const uint8_t *arguments, size_t n);

/* A frame that is composed, and its signals in tables of all frames. */
typedef struct {
    uint32_t identifier;
    int32_t is_extended, is_fd, length, kind, modulus, first, n_signals;
    SbSlot protection;
} SentFrame;

enum { MOST_SIGNALS = 512 }; /* a bit each */

/* Send a frame with the values of its signals; 0 if a value does not fit, which counts as lost. */
int link_send_frame(Link *link, const SentFrame *frame, const SbSignal *signal, const double *value, int counter);

int link_check(const Link *link);

/* Set an array of a resource of so many bytes; 0 if it does not lie in there. */
int array_of(const unsigned char *bytes, size_t length, int64_t place, int64_t count, size_t each, const void **array);

#endif
