/* Ports of an FMU to networks, as FMI-LS-BUS 1.0 has them: operations as bytes that are heard and sent, each time in the
   tick of a clock. The front of FMI 3.0 moves bytes, clocks and time (fmi3/fmi3_ports.c); a library that has ports lists
   the kinds of its nodes in PORTS, next to its model.

   An instance with the resource of a kind has a node of that kind, with one port or several. An event goes: hear what
   came, tick where a transmit clock does, read what is sealed then, update. */

#ifndef PORTS_H
#define PORTS_H

#include "model.h"

enum {
    PORT_BYTES = 8192, /* of the operations of a tick, of either direction */
    REPLY_BYTES = 272,
    MAX_PORTS = 8
};

enum { PORT_RECEIVED, PORT_USED, PORT_SENT, PORT_CONFIRMED, PORT_ERRORS, PORT_LOST, N_PORT_COUNTERS };

/* What was heard and not read yet, and what goes in the next tick of the transmit clock: after a reply, if there is any. */
typedef struct {
    uint64_t counter[N_PORT_COUNTERS];
    uint32_t n_heard, n_reply, n_out;
    int32_t is_ticking, has_begun, padding;
    uint8_t heard[PORT_BYTES], out[PORT_BYTES], reply[REPLY_BYTES];
} Link;

typedef struct {
    const char *resource; /* name of its file in resources/ */
    int steps_model;      /* whether the model goes on in steps; if not, operations move it */
    void *(*create)(Model *model, unsigned char *bytes, size_t length, char text[MODEL_TEXT_SIZE]); /* owns the bytes */
    void (*destroy)(void *node);
    void (*begin)(void *node, double time);              /* the initialization ends, or a reset */
    int (*is_triggered)(const void *node);               /* whether transmit clocks are outputs */
    Link *(*link)(const void *node, size_t port);        /* NULL behind the last port */
    double (*due)(const void *node, size_t port);        /* time of the next tick of a transmit clock [s], or infinite */
    void (*tick)(void *node, size_t port, double time);  /* a transmit clock ticks: seal what goes */
    void (*update)(void *node, double time);             /* the event ends: what was sealed is gone, what was heard counts */
    void *(*state)(const void *node, size_t *size);      /* all that changes, without pointers */
    int (*check_state)(const void *node, const unsigned char *bytes, char text[MODEL_TEXT_SIZE]);
} Ports;

/* Ends with NULL. */
extern const Ports *const PORTS[];

#endif
