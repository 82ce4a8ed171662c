/* A CAN FD bus as an FMU, a port for each node: time on the wire, arbitration by identifier, confirmation.

   A frame waits in the queue of its port until the bus is free and no other port has a frame of higher priority. At its
   end it arrives at all other ports, and its sender gets a Confirm. A frame at other bit rates than another node's is a
   Bus Error. Time on the wire is that of the fixed fields, the data and the fixed stuff bits of the CRC; stuff bits that
   depend on the content are not counted. Sources: ISO 11898-1:2015; FMI-LS-BUS 1.0.0, section 5.5.1. */

#include <math.h>

#include "../network/link.h"

enum { QUEUE = 64, OTHER_BIT_RATE = 1 };

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

/* What lies behind the ports in the state. */
typedef struct {
    double end;              /* of the frame on the wire [s] */
    int32_t sender, is_busy; /* its port */
} Wire;

static Port *ports_of(const Node *bus) {
    return bus->state;
}

static Wire *wire_of(const Node *bus) {
    return (Wire *)(void *)(ports_of(bus) + bus->setup->n_ports);
}

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
static int differs(const Node *bus, const Port *sender) {
    int other = 0;
    for (int p = 0; p < bus->setup->n_ports; p++) {
        for (int k = 0; k < 2; k++) {
            const uint32_t rate = ports_of(bus)[p].rate[k];
            other = other || (rate > 0 && sender->rate[k] > 0 && rate != sender->rate[k]);
        }
    }
    return other;
}

/* Arbitration: the next frame goes on the wire, if there is any. */
static void arbitrate(Node *bus, double time) {
    Wire *wire = wire_of(bus);
    while (!wire->is_busy) {
        Port *best = NULL;
        for (int p = 0; p < bus->setup->n_ports; p++) {
            Port *port = ports_of(bus) + p;
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
        wire->is_busy = 1;
        wire->sender = (int32_t)(best - ports_of(bus));
        wire->end = time + duration(best, head_of(best));
    }
}

/* The frame on the wire ends, and arrives. */
static void finish(Node *bus, double time) {
    Wire *wire = wire_of(bus);
    if (!wire->is_busy || wire->end > time + TIME_ROUND_OFF) {
        return;
    }
    Port *sender = ports_of(bus) + wire->sender;
    const Frame *frame = head_of(sender);
    for (int p = 0; p < bus->setup->n_ports; p++) {
        Port *port = ports_of(bus) + p;
        if (port == sender) {
            link_send(&port->link, CONFIRM, frame->operation + OPERATION_HEAD, 4);
        } else {
            const uint32_t code = (uint32_t)get_number(frame->operation, 4);
            link_send(&port->link, code, frame->operation + OPERATION_HEAD, frame->n - OPERATION_HEAD);
            port->link.counter[PORT_SENT]++;
        }
    }
    wire->is_busy = 0;
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

static void tick(Node *bus, size_t port, double time) {
    finish(bus, time);
    link_tick(&ports_of(bus)[port].link, bus->setup);
}

static void update(Node *bus, double time) {
    finish(bus, time);
    for (int p = 0; p < bus->setup->n_ports; p++) {
        Port *port = ports_of(bus) + p;
        Heard heard;
        link_end_tick(&port->link);
        for (size_t at = 0; link_next(&port->link, &at, &heard);) {
            take(port, &heard);
        }
    }
    arbitrate(bus, time);
}

static double due(const Node *bus, size_t port) {
    const Wire *wire = wire_of(bus);
    return ports_of(bus)[port].link.n_out > 0 ? -INFINITY : wire->is_busy ? wire->end : INFINITY;
}

static size_t prepare(Node *bus) {
    return (size_t)bus->setup->n_ports * sizeof(Port) + sizeof(Wire);
}

static void begin(Node *bus, double time) {
    (void)time;
    for (int p = 0; p < bus->setup->n_ports; p++) {
        ports_of(bus)[p].link.has_begun = 1; /* a bus states no rates */
    }
}

static int check_state(const Node *bus, const void *state) {
    const int n_ports = bus->setup->n_ports;
    const Port *port = state;
    const Wire *wire = (const Wire *)(const void *)(port + n_ports);
    int good = wire->sender >= 0 && wire->sender < n_ports && (!wire->is_busy || port[wire->sender].n > 0);
    for (int p = 0; good && p < n_ports; p++, port++) {
        good = port->first >= 0 && port->first < QUEUE && port->n >= 0 && port->n <= QUEUE;
        for (int k = 0; good && k < port->n; k++) {
            const uint32_t n = port->queue[(port->first + k) % QUEUE].n;
            good = n >= OPERATION_HEAD + CAN_HEAD && n <= sizeof port->queue[k].operation;
        }
    }
    return good;
}

const NodeKind CAN_BUS = {
    .resource = "can.bin",
    .most_ports = MAX_PORTS,
    .node_size = sizeof(Node),
    .port_size = sizeof(Port),
    .prepare = prepare,
    .begin = begin,
    .due = due,
    .tick = tick,
    .update = update,
    .check_state = check_state,
};
