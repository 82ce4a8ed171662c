/* The estimator as an ECU on a CAN bus: strain frames in, result frames out.

   Every cycle is that of a bridge (bridge/), whose estimator is the model of this FMU. A result waits for `response_time`;
   it goes out with the first tick after that, and is sealed there: its age grows until the tick, its counter and CRC are
   those of the sending.

   All memory of a node lies in one block without pointers behind `State`: the state of the FMU is a copy of it. */

#include <math.h>
#include <string.h>

#include "../bridge/bridge.h"
#include "../core/floating.h"
#include "../network/link.h"

enum { QUEUE = 16 };

/* The tables of resources/bus.bin, as strainfmu/packaging/ecu.py writes them: the records that a bridge in Python has, and
   their arrays, as bytes that stay as they are and bytes that change; and the addresses in the former. */
enum { SETUP, FIXED, CHANGING, ADDRESS };

typedef struct {
    double response_time, status_period; /* [s] */
    int64_t bridge;                      /* place of SbBridge */
} EcuSetup;

typedef struct {
    int32_t at, place, changes, padding; /* of the address; to which it leads, and whether in what changes */
} Address;

typedef struct {
    Link link;
    double estimator_time, last_step, next_status; /* [s]; last_step NaN before the first */
    double release[QUEUE];                         /* of the results that wait for their tick [s] */
    SbLast last;
    int32_t first, n_waiting;
} State; /* ahead of what changes, which the values of those results follow */

typedef struct {
    Node node;
    const EcuSetup *setup;
    SbBridge *bridge;
} Ecu;

static State *state_of(const Ecu *ecu) {
    return ecu->node.state;
}

/* The machine is the first that changes. */
static const SbState *machine_in(const State *state) {
    return (const SbState *)(const void *)(state + 1);
}

static int64_t count_of(const Node *node, int table) {
    return node->setup->table[table].count;
}

static size_t n_values(const SbBridge *b) {
    return (size_t)(R_OTHERS + b->n_others + N_DETAILS);
}

static double *waiting(const Ecu *ecu, int place) {
    unsigned char *behind = (unsigned char *)(state_of(ecu) + 1) + count_of(&ecu->node, CHANGING);
    return (double *)(void *)behind + n_values(ecu->bridge) * (size_t)place;
}

/* --- the estimator: functions as FMI 2.0 has them --------------------------------------------------------------------- */

static int move(Model *model, Type type, int is_output, const uint32_t *number, size_t n, void *value) {
    char text[MODEL_TEXT_SIZE];
    const Selection which = {number, 0, n};
    const int good = is_output ? model_get(model, type, &which, value, text) : model_set(model, type, &which, value, text);
    return good ? STATUS_OK : STATUS_ERROR;
}

static int set_real(void *model, const uint32_t *number, size_t n, void *value) {
    return move(model, REAL, 0, number, n, value);
}

static int set_integer(void *model, const uint32_t *number, size_t n, void *value) {
    return move(model, INTEGER, 0, number, n, value);
}

static int get_real(void *model, const uint32_t *number, size_t n, void *value) {
    return move(model, REAL, 1, number, n, value);
}

static int get_integer(void *model, const uint32_t *number, size_t n, void *value) {
    return move(model, INTEGER, 1, number, n, value);
}

static int do_step(void *model, double time, double size, int no_going_back) {
    char text[MODEL_TEXT_SIZE];
    (void)no_going_back;
    return model_step(model, time, time + size, text);
}

/* --- results ---------------------------------------------------------------------------------------------------------- */

/* The result of the machine is ready: estimate, answer, and let its frames wait. */
static void publish(Ecu *ecu) {
    State *s = state_of(ecu);
    SbBridge *b = ecu->bridge;
    SbEstimator *e = b->estimator;
    Model *model = ecu->node.model;
    const double time = model->time, release = b->state->result.time + ecu->setup->response_time;
    const Mode mode = model->mode;
    model->mode = STEP; /* its own steps, at its own time */
    model_set_time(model, s->estimator_time);
    e->time = s->estimator_time;
    b->last_step = s->last_step;
    b->last = s->last;
    for (int32_t k = 0; k < e->n_exchanges; k++) {
        e->exchange[k].is_given = 0; /* a state that was set may have other numbers */
    }
    (void)sb_estimate(b);
    const int is_sent = sb_conclude(b, &release);
    if (is_sent && s->n_waiting == QUEUE) {
        s->link.counter[PORT_LOST]++;
    } else if (is_sent) {
        const int place = (s->first + s->n_waiting++) % QUEUE;
        s->release[place] = release;
        result_of(b, waiting(ecu, place));
    }
    s->last = b->last;
    s->last_step = b->last_step;
    s->estimator_time = e->time;
    model->mode = mode;
    model_set_time(model, time);
}

/* What is due by now: cycles at their deadline, and silence. */
static void advance(Ecu *ecu, double time) {
    SbState *machine = ecu->bridge->state;
    for (;;) {
        const double next = machine->deadline < machine->next_status ? machine->deadline : machine->next_status;
        if (next > time + TIME_ROUND_OFF) {
            return;
        }
        const double now = next > time ? next : time;
        if (sb_due(ecu->bridge->plan, machine, &now) == SB_READY) {
            publish(ecu);
        }
    }
}

static void take_frame(Ecu *ecu, const Heard *heard, double time) {
    SbLogged *frame = ecu->bridge->heard;
    frame->time = time;
    frame->key = heard->key;
    frame->n = (uint8_t)heard->n;
    frame->flags = (uint8_t)((heard->is_fd ? SB_IS_FD : 0) | (heard->is_remote ? SB_IS_REMOTE : 0));
    int event = SB_AGAIN;
    while (event == SB_AGAIN) {
        event = sb_hear(ecu->bridge, heard->data);
        if (event == SB_READY || event == SB_AGAIN) {
            publish(ecu);
        }
    }
    if (event == SB_OTHER) {
        sb_refuse(ecu->bridge, heard->data);
    }
}

/* --- frames out ------------------------------------------------------------------------------------------------------- */

/* Send the composed frames of a kind; `refused` of compose_frames. */
static void send(Ecu *ecu, int kind, int refused) {
    const SbBridge *b = ecu->bridge;
    Link *link = &state_of(ecu)->link;
    link->counter[PORT_LOST] += refused >= 0;
    for (int32_t f = 0; f < b->n_frames && refused < 0; f++) {
        if (b->frame[f].kind == kind) {
            link_send_frame(link, &b->frame[f], b->data + MOST_BYTES * f);
        }
    }
}

static void send_result(Ecu *ecu, double *value) {
    const SbBridge *b = ecu->bridge;
    const double *details = details_in(b, value);
    send(ecu, OF_RESULT, compose_frames(b, OF_RESULT, value));
    if (has_details((uint32_t)details[D_CAUSES])) {
        send(ecu, OF_DETAIL, compose_frames(b, OF_DETAIL, details));
    }
}

static void send_status(Ecu *ecu, double time) {
    State *s = state_of(ecu);
    ecu->bridge->last = s->last;
    const int refused = sb_compose_status(ecu->bridge, &time);
    send(ecu, OF_STATUS, refused);
    send(ecu, OF_DETAIL, refused);
    s->next_status += ecu->setup->status_period;
    s->next_status = s->next_status > time ? s->next_status : time;
}

static void tick(Node *node, size_t port, double time) {
    Ecu *ecu = (Ecu *)node;
    State *s = node->state;
    (void)port;
    if (!link_tick(&s->link, node->setup)) {
        return;
    }
    const Floating host = floating_enter();
    advance(ecu, time);
    while (s->n_waiting > 0 && s->release[s->first] <= time + TIME_ROUND_OFF) {
        double *value = waiting(ecu, s->first);
        value[R_AGE] += time > s->release[s->first] ? 1e3 * (time - s->release[s->first]) : 0.0;
        send_result(ecu, value);
        s->first = (s->first + 1) % QUEUE;
        s->n_waiting--;
    }
    if (s->next_status <= time + TIME_ROUND_OFF) {
        send_status(ecu, time);
    }
    floating_leave(&host);
}

static double due(const Node *node, size_t port) {
    const State *s = node->state;
    const SbState *machine = machine_in(s);
    double next = s->next_status;
    (void)port;
    next = s->n_waiting > 0 && s->release[s->first] < next ? s->release[s->first] : next;
    next = machine->deadline < next ? machine->deadline : next;
    return machine->next_status < next ? machine->next_status : next;
}

static void update(Node *node, double time) {
    Ecu *ecu = (Ecu *)node;
    Link *link = node_link(node, 0);
    Heard heard;
    link_end_tick(link);
    if (link->n_heard > 0) {
        advance(ecu, time);
    }
    for (size_t at = 0; link_next(link, &at, &heard);) {
        if (heard.is_frame) {
            take_frame(ecu, &heard, time);
        }
    }
    link->counter[PORT_USED] = (uint64_t)ecu->bridge->state->account.count[SB_USED];
}

/* --- creation and state ----------------------------------------------------------------------------------------------- */

static unsigned char *fixed_of(const Node *node) {
    return node->bytes + node->setup->table[FIXED].place;
}

/* Set the addresses in the records, which lead to arrays beside them or in the state, and to functions of the model. */
static void set_addresses(Ecu *ecu) {
    const Node *node = &ecu->node;
    const Address *address = node->table[ADDRESS];
    unsigned char *changing = (unsigned char *)(state_of(ecu) + 1);
    for (int64_t k = 0; k < count_of(node, ADDRESS); k++, address++) {
        void *to = (address->changes ? changing : fixed_of(node)) + address->place;
        memcpy(fixed_of(node) + address->at, &to, sizeof to);
    }
    SbEstimator *e = ecu->bridge->estimator;
    e->component = node->model;
    e->step = do_step;
    for (int32_t k = 0; k < e->n_exchanges; k++) {
        SbExchange *x = &e->exchange[k];
        x->move = x->is_output ? (x->is_whole ? get_integer : get_real) : x->is_whole ? set_integer : set_real;
    }
}

static void begin(Node *node, double time) {
    Ecu *ecu = (Ecu *)node;
    State *s = node->state;
    memcpy(s + 1, node->table[CHANGING], (size_t)count_of(node, CHANGING));
    set_addresses(ecu);
    s->last_step = NAN;
    s->estimator_time = s->next_status = time;
    sb_begin(ecu->bridge->plan, ecu->bridge->state, time);
}

static size_t prepare(Node *node) {
    Ecu *ecu = (Ecu *)node;
    const int64_t n_fixed = count_of(node, FIXED), n_changing = count_of(node, CHANGING);
    const Address *address = node->table[ADDRESS];
    int good = count_of(node, SETUP) == 1 && n_changing % 8 == 0;
    ecu->setup = node->table[SETUP];
    good = good && ecu->setup->bridge >= 0 && ecu->setup->bridge + (int64_t)sizeof(SbBridge) <= n_fixed;
    for (int64_t k = 0; good && k < count_of(node, ADDRESS); k++, address++) {
        good = address->at >= 0 && address->at + (int64_t)sizeof(void *) <= n_fixed && address->place >= 0
            && address->place < (address->changes ? n_changing : n_fixed);
    }
    if (!good) {
        return 0;
    }
    ecu->bridge = (SbBridge *)(void *)(fixed_of(node) + ecu->setup->bridge);
    return sizeof(State) + (size_t)n_changing + QUEUE * n_values(ecu->bridge) * sizeof(double);
}

static int check_state(const Node *node, const void *state) {
    const State *s = state;
    const SbState *machine = machine_in(s), *now = machine_in(node->state);
    return s->first >= 0 && s->first < QUEUE && s->n_waiting >= 0 && s->n_waiting <= QUEUE
        && memcmp(&machine->slots_at, &now->slots_at, 8 * sizeof machine->slots_at) == 0;
}

static const NodeKind ECU = {
    .resource = "bus.bin",
    .most_ports = 1,
    .node_size = sizeof(Ecu),
    .port_size = sizeof(Link),
    .row_size = {sizeof(EcuSetup), 1, 1, sizeof(Address)},
    .prepare = prepare,
    .begin = begin,
    .due = due,
    .tick = tick,
    .update = update,
    .check_state = check_state,
};

const NodeKind *const NODE_KINDS[] = {&ECU, NULL};
