/* A CAN FD bus as an FMU, a port for each node: time on the wire, arbitration by identifier, confirmation.

   A frame waits in the queue of its port until the bus is free and no other port has a frame of higher priority. At its
   end it arrives at all other ports, and its sender gets a Confirm. A frame at other bit rates than another node's is a
   Bus Error. Time on the wire is that of the fixed fields, the data and the fixed stuff bits of the CRC; stuff bits that
   depend on the content are not counted. Sources: ISO 11898-1:2015; FMI-LS-BUS 1.0.0, section 5.5.1. */

#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>

#include "../core/resource.h"
#include "../network/link.h"
#include "nodes.h"

enum { QUEUE = 64, OTHER_BIT_RATE = 1, HEADER_OF_RESOURCE = 32 };

typedef struct {
    uint32_t key, n;
    uint8_t operation[88]; /* as it came */
} Frame;

typedef struct {
    Link link;
    uint32_t rate[2]; /* of CAN, of data in CAN FD [bit/s]; 0 if it was not stated */
    int32_t first, n;
    Frame queue[QUEUE];
} Port;

typedef struct {
    double end;             /* of the frame on the wire [s] */
    int32_t sender, is_busy; /* its port */
    Port port[MAX_PORTS];
} State;

typedef struct {
    int32_t n_ports;
    State state;
} Bus;

static Frame *head_of(Port *port) {
    return port->n > 0 ? &port->queue[port->first] : NULL;
}

static void remove_head(Port *port) {
    port->first = (port->first + 1) % QUEUE;
    port->n--;
}

/* The smallest number wins: the first 11 bits, then 11 bits before 29, then the others. */
static uint32_t priority(const Frame *frame) {
    const uint32_t identifier = frame->key & ~EXTENDED_FLAG;
    return frame->key & EXTENDED_FLAG ? identifier >> 18 << 19 | 1u << 18 | (identifier & 0x3FFFF) : identifier << 19;
}

/* Time on the wire [s], with the three bits between frames. */
static double duration(const Port *sender, const Frame *frame) {
    const double slow = sender->rate[0] > 0 ? sender->rate[0] : 500e3;
    const int is_fd = get_number(frame->operation, 4) == CAN_FD_TRANSMIT, is_extended = frame->key & EXTENDED_FLAG ? 1 : 0;
    const double bytes = frame->n - OPERATION_HEAD - (is_fd ? CAN_FD_HEAD : CAN_HEAD);
    const double fast = is_fd && frame->operation[OPERATION_HEAD + 5] && sender->rate[1] > 0 ? sender->rate[1] : slow;
    if (!is_fd) {
        return (47.0 + (is_extended ? 20.0 : 0.0) + 8.0 * bytes) / slow;
    }
    return (13.0 + (is_extended ? 36.0 : 17.0)) / slow + (5.0 + 8.0 * bytes + (bytes > 16.0 ? 31.0 : 26.0)) / fast;
}

/* Whether another node has stated another bit rate. */
static int differs(const Bus *bus, const Port *sender) {
    int other = 0;
    for (int p = 0; p < bus->n_ports; p++) {
        for (int k = 0; k < 2; k++) {
            const uint32_t rate = bus->state.port[p].rate[k];
            other = other || (rate > 0 && sender->rate[k] > 0 && rate != sender->rate[k]);
        }
    }
    return other;
}

/* Arbitration: the next frame goes on the wire, if there is any. */
static void arbitrate(Bus *bus, double time) {
    State *s = &bus->state;
    while (!s->is_busy) {
        Port *best = NULL;
        for (int p = 0; p < bus->n_ports; p++) {
            Port *port = &s->port[p];
            best = head_of(port) != NULL && (best == NULL || priority(head_of(port)) < priority(head_of(best))) ? port : best;
        }
        if (best == NULL) {
            return;
        }
        if (differs(bus, best)) {
            uint8_t arguments[7] = {0};
            memcpy(arguments, head_of(best)->operation + OPERATION_HEAD, 4);
            arguments[4] = OTHER_BIT_RATE;
            arguments[5] = arguments[6] = 1; /* primary; of the sender */
            link_send(&best->link, BUS_ERROR, arguments, sizeof arguments);
            best->link.counter[PORT_LOST]++;
            remove_head(best);
            continue;
        }
        s->is_busy = 1;
        s->sender = (int32_t)(best - s->port);
        s->end = time + duration(best, head_of(best));
    }
}

/* The frame on the wire ends, and arrives. */
static void finish(Bus *bus, double time) {
    State *s = &bus->state;
    if (!s->is_busy || s->end > time + TIME_ROUND_OFF) {
        return;
    }
    Port *sender = &s->port[s->sender];
    const Frame *frame = head_of(sender);
    for (int p = 0; p < bus->n_ports; p++) {
        Port *port = &s->port[p];
        if (port == sender) {
            link_send(&port->link, CONFIRM, frame->operation + OPERATION_HEAD, 4);
        } else {
            const uint32_t code = (uint32_t)get_number(frame->operation, 4);
            link_send(&port->link, code, frame->operation + OPERATION_HEAD, frame->n - OPERATION_HEAD);
            port->link.counter[PORT_SENT]++;
        }
    }
    s->is_busy = 0;
    remove_head(sender);
}

static void take(Port *port, const Heard *heard) {
    const size_t n = heard->length + OPERATION_HEAD;
    if (heard->is_frame && port->n == QUEUE) {
        port->link.counter[PORT_LOST]++;
    } else if (heard->is_frame) {
        Frame *frame = &port->queue[(port->first + port->n++) % QUEUE];
        frame->key = heard->key;
        frame->n = (uint32_t)n;
        memcpy(frame->operation, heard->arguments - OPERATION_HEAD, n);
        port->link.counter[PORT_USED]++;
    } else if (heard->code == CONFIGURATION_OF_BUS && heard->length == 5) {
        const int kind = heard->arguments[0];
        if (kind == CAN_RATE || kind == CAN_FD_RATE) {
            port->rate[kind - CAN_RATE] = (uint32_t)get_number(heard->arguments + 1, 4);
        }
    }
}

static void tick(void *of, size_t port, double time) {
    Bus *bus = of;
    finish(bus, time);
    link_tick(&bus->state.port[port].link, 0, 0);
}

static void update(void *of, double time) {
    Bus *bus = of;
    finish(bus, time);
    for (int p = 0; p < bus->n_ports; p++) {
        Port *port = &bus->state.port[p];
        Heard heard;
        link_end_tick(&port->link);
        for (size_t at = 0; link_next(&port->link, &at, &heard);) {
            take(port, &heard);
        }
    }
    arbitrate(bus, time);
}

static double due(const void *of, size_t port) {
    const State *s = &((const Bus *)of)->state;
    const Link *link = &s->port[port].link;
    return link->n_out + link->n_reply > 0 ? -INFINITY : s->is_busy ? s->end : INFINITY;
}

static Link *link_of(const void *of, size_t port) {
    Bus *bus = (Bus *)(uintptr_t)of;
    return port < (size_t)bus->n_ports ? &bus->state.port[port].link : NULL;
}

static int is_triggered(const void *node) {
    (void)node;
    return 0;
}

static void begin(void *of, double time) {
    Bus *bus = of;
    (void)time;
    memset(&bus->state, 0, sizeof bus->state);
    for (int p = 0; p < bus->n_ports; p++) {
        bus->state.port[p].link.has_begun = 1; /* a bus states no rates */
    }
}

static void *create(Model *model, unsigned char *bytes, size_t length, char text[MODEL_TEXT_SIZE]) {
    Bus *bus = NULL;
    (void)model;
    if (resource_check(bytes, length, "SFMUCAN", CAN_BUS_VERSION, "bus", text)) {
        const uint32_t n_ports = length == HEADER_SIZE ? u32_at(bytes, HEADER_OF_RESOURCE) : 0;
        bus = n_ports >= 1 && n_ports <= MAX_PORTS ? calloc(1, sizeof *bus) : NULL;
        if (bus != NULL) {
            bus->n_ports = (int32_t)n_ports;
        } else {
            snprintf(text, MODEL_TEXT_SIZE, "holds no bus of 1 to %d ports, or there is no memory for it", MAX_PORTS);
        }
    }
    free(bytes);
    return bus;
}

static void *state(const void *of, size_t *size) {
    Bus *bus = (Bus *)(uintptr_t)of;
    *size = offsetof(State, port) + (size_t)bus->n_ports * sizeof(Port);
    return &bus->state;
}

static int check_state(const void *of, const unsigned char *bytes, char text[MODEL_TEXT_SIZE]) {
    const int n_ports = ((const Bus *)of)->n_ports;
    size_t size;
    (void)state(of, &size);
    State *s = malloc(size);
    int good = s != NULL;
    if (good) {
        memcpy(s, bytes, size);
        good = s->sender >= 0 && s->sender < n_ports && (!s->is_busy || s->port[s->sender].n > 0);
    }
    for (int p = 0; good && p < n_ports; p++) {
        const Port *port = &s->port[p];
        good = link_check(&port->link) && port->first >= 0 && port->first < QUEUE && port->n >= 0 && port->n <= QUEUE;
        for (int k = 0; good && k < port->n; k++) {
            const uint32_t n = port->queue[(port->first + k) % QUEUE].n;
            good = n >= OPERATION_HEAD + CAN_HEAD && n <= sizeof port->queue[k].operation;
        }
    }
    free(s);
    if (!good) {
        snprintf(text, MODEL_TEXT_SIZE, "holds frames that cannot be");
    }
    return good;
}

const Ports CAN_BUS = {
    .resource = "can.bin",
    .create = create,
    .destroy = free,
    .begin = begin,
    .is_triggered = is_triggered,
    .link = link_of,
    .due = due,
    .tick = tick,
    .update = update,
    .state = state,
    .check_state = check_state,
};
