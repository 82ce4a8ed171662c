/* Ports of an FMU to networks, as FMI-LS-BUS 1.0 has them: operations as bytes that are heard and sent, each time in the
   tick of a clock. The front of FMI 3.0 moves bytes, clocks and time (fmi3/fmi3_ports.c); a library that has ports
   implements PORTS next to its model.

   One instance has one port. Its state is a node, made from a resource of its own; an instance without that file has
   none. An event goes: hear what came, tick if the transmit clock does, read what is sealed then, update. */

#ifndef PORTS_H
#define PORTS_H

#include "model.h"

/* Bytes of the operations of a tick, of either direction. */
#define PORT_BYTES 8192

enum { PORT_RECEIVED, PORT_USED, PORT_SENT, PORT_CONFIRMED, PORT_ERRORS, PORT_LOST, N_PORT_COUNTERS };

typedef struct {
    const char *resource; /* name of its file in resources/, NULL for a library without ports */
    void *(*create)(Model *model, unsigned char *bytes, size_t length, char text[MODEL_TEXT_SIZE]); /* owns the bytes */
    void (*destroy)(void *node);
    void (*reset)(void *node);
    void (*start)(void *node, double time);               /* the initialization ends */
    int (*is_triggered)(const void *node);                /* whether the transmit clock is an output */
    int (*hear)(void *node, const unsigned char *bytes, size_t n); /* 0: there is no place for them */
    double (*due)(const void *node);                      /* time of the next tick of the transmit clock [s] */
    void (*tick)(void *node, double time);                /* the transmit clock ticks: seal what goes */
    const unsigned char *(*sealed)(const void *node, size_t *n); /* nothing but in a tick */
    void (*update)(void *node, double time);              /* the event ends: what was sealed is gone, what was heard counts */
    uint64_t (*counter)(const void *node, size_t which);
    size_t (*state_size)(const void *node);
    void (*write_state)(const void *node, unsigned char *bytes);
    int (*check_state)(const void *node, const unsigned char *bytes, char text[MODEL_TEXT_SIZE]);
    void (*read_state)(void *node, const unsigned char *bytes);
} Ports;

extern const Ports PORTS;

#endif
