/* Ports of an FMU to networks, as FMI-LS-BUS 1.0 has them: operations as bytes that are heard and sent, each time in the
   tick of a clock. The front of FMI 3.0 moves bytes, clocks and time (fmi3/fmi3_ports.c); a library that has ports lists
   the kinds of its nodes in NODE_KINDS, next to its model.

   An instance with the resource of a kind has a node of that kind, with one port or several. An event goes: hear what
   came, tick where a transmit clock does, read what is sealed then, update. */

#ifndef PORTS_H
#define PORTS_H

#include "model.h"

enum {
    PORT_BYTES = 8192, /* of the operations of a tick, of either direction */
    REPLY_BYTES = 272,
    MAX_PORTS = 8,
    MAX_TABLES = 5
};

enum { PORT_RECEIVED, PORT_USED, PORT_SENT, PORT_CONFIRMED, PORT_ERRORS, PORT_LOST, N_PORT_COUNTERS };

/* What was heard and not read yet, and what goes in the next tick of the transmit clock: after a reply, if there is any. */
typedef struct {
    uint64_t counter[N_PORT_COUNTERS];
    uint32_t n_heard, n_reply, n_out;
    int32_t is_ticking, has_begun, padding;
    uint8_t heard[PORT_BYTES], out[PORT_BYTES], reply[REPLY_BYTES];
} Link;

/* The file of a node in resources/, as strainfmu/fmu/description/port.py writes it: a header of 32 bytes, this record,
   then the tables of its kind, at places in bytes from the start of the file. */
typedef struct {
    char guid[96];
    int32_t n_ports, is_triggered; /* whether transmit clocks are outputs */
    int32_t can_rate, fd_rate;     /* bit/s; 0 without CAN FD */
    struct {
        int64_t place, count;
    } table[MAX_TABLES];
} NodeSetup;

typedef struct NodeKind NodeKind;

/* What every node begins with. */
typedef struct {
    const NodeKind *kind;
    Model *model;
    unsigned char *bytes;   /* of its file */
    const NodeSetup *setup; /* there */
    const void *table[MAX_TABLES];
    void *state; /* all that changes, without pointers; its ports come first, each begins with its link */
    size_t size; /* of the state [bytes] */
} Node;

struct NodeKind {
    const char *resource; /* name of its file in resources/ */
    int steps_model;      /* whether the model goes on in steps; if not, operations move it */
    int most_ports;
    size_t node_size, port_size;
    size_t row_size[MAX_TABLES];                          /* of each table, 0 behind the last one */
    size_t (*prepare)(Node *node);                        /* its tables are set: the state's size; 0 if they are wrong */
    void (*begin)(Node *node, double time);               /* set a state of zeros to its start */
    double (*due)(const Node *node, size_t port);         /* time of the next tick of a transmit clock [s], or infinite */
    void (*tick)(Node *node, size_t port, double time);   /* a transmit clock ticks: seal what goes */
    void (*update)(Node *node, double time);              /* the event ends: sealed is gone, heard counts */
    int (*check_state)(const Node *node, const void *of); /* beyond its links; NULL for nothing */
};

/* Ends with NULL. */
extern const NodeKind *const NODE_KINDS[];

/* The node of a model by the bytes of its file [length], which it owns: they are freed here if that fails. NULL, after a
   message. */
Node *node_create(const NodeKind *kind, Model *model, unsigned char *bytes, size_t length, char text[MODEL_TEXT_SIZE]);

void node_destroy(Node *node);

/* The initialization ends at a time [s], or a reset. */
void node_begin(Node *node, double time);

/* The link of a port; NULL behind the last one. */
Link *node_link(const Node *node, size_t port);

/* When the transmit clock of a port is to tick [s]: at once for a start or a reply, never if infinite. */
double node_due(const Node *node, size_t port);

/* Whether bytes of the state's size may be it; if not, text states what is wrong. */
int node_check_state(const Node *node, const unsigned char *bytes, char text[MODEL_TEXT_SIZE]);

#endif
