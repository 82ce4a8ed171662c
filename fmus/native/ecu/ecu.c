/* The estimator as an ECU on a CAN bus: strain frames in, result frames out.

   The bridge's state machine (bus/) takes the frames in; here are what the bridge does around it in Python: estimator
   steps of whole cycles (strainfmu/can/machine.py), and the composition of result and status frames
   (strainfmu/can/result_frames.py). A result waits for `response_time`; it goes out with the first tick after that,
   and is sealed there: its age grows until the tick, its counter and CRC are those of the sending.

   All memory of a node lies in one block without pointers behind `State`: the state of the FMU is a copy of it. */

#include <math.h>
#include <string.h>

#include "../core/floating.h"
#include "../network/link.h"

#define LONGEST_STEP 100   /* cycles in one step of the estimator */

enum { QUEUE = 16, NO_COEFFICIENTS = 2 };

/* --- the tables of resources/bus.bin, as strainfmu/packaging/ecu.py writes them ------------------------------------------ */

enum { SETUP, PLAN, SLOT, SIGNAL, CODE, CHANGE, KEY, QUANTITY, CONSTANT, OTHER, FRAME, SENT, SOURCE };

typedef struct {
    uint32_t key;
    int32_t slot; /* the first of the identifier; -1 of a frame that bridges send */
} EcuKey;

/* A quantity of the flow, or a constant: the variable that takes it, and what stands for a value that is not above 0. */
typedef struct {
    int32_t variable, is_whole;
    double value, fallback; /* of a constant; NaN for none */
} EcuQuantity;

typedef struct {
    int32_t variable, padding;
    double step; /* in which its value is rounded up, 0 for none */
} EcuOther;

typedef struct {
    double response_time, status_period, bridge_alarm; /* [s] */
    int32_t needs_pressure, configuration, strain, padding;
} EcuSetup;

/* --- values and state ----------------------------------------------------------------------------------------------- */

/* Numbers of FMI 2.0 of outputs of the estimator: estimator/sample/sample.h. */
enum { HEALTH_OUTPUT = 20, CHI_SQUARE_OUTPUT = 21, ENVELOPE_OUTPUT = 26 };

/* A result that waits for its tick; its values lie behind the state. */
typedef struct {
    double release; /* [s] */
    double detail[N_DETAILS];
    int32_t has_details, padding;
} Waiting;

typedef struct {
    Link link;
    double estimator_time, last_step, next_status; /* [s]; last_step NaN before the first */
    SbLast last;
    int32_t first, n_waiting;
    Waiting waiting[QUEUE];
} State;

typedef struct {
    Node node;
    const EcuSetup *setup;
    SbPlan plan;
    size_t n_values, strain_at, machine_at, counters_at; /* of the state */
} Ecu;

static State *state_of(const Ecu *ecu) {
    return ecu->node.state;
}

static SbState *machine_of(const Ecu *ecu) {
    return (SbState *)(void *)((unsigned char *)ecu->node.state + ecu->machine_at);
}

static double *values_of(const Ecu *ecu, int waiting) {
    return (double *)(void *)(state_of(ecu) + 1) + ecu->n_values * (size_t)waiting;
}

static uint8_t *counters_of(const Ecu *ecu) {
    return (uint8_t *)ecu->node.state + ecu->counters_at;
}

static int64_t count_of(const Ecu *ecu, int table) {
    return ecu->node.setup->table[table].count;
}

static size_t rounded(size_t bytes) {
    return (bytes + 7) / 8 * 8;
}

/* --- the estimator -------------------------------------------------------------------------------------------------- */

/* Give a value to an input: text is not needed, since every input takes any number. */
static void give(Model *model, const EcuQuantity *to, double value) {
    char text[MODEL_TEXT_SIZE];
    const Selection which = {NULL, (size_t)to->variable, 1};
    if (to->is_whole) {
        const int number = value > 0.0 && value < 100.0 ? (int)(value + 0.5) : 0;
        (void)model_set(model, INTEGER, &which, &number, text);
        return;
    }
    const double given = !isnan(to->fallback) && !(value > 0.0) ? to->fallback : value;
    (void)model_set(model, REAL, &which, &given, text);
}

/* Step by whole cycles, with the strains and the flow of the result that is ready. */
static void step_estimator(Ecu *ecu, double now) {
    State *s = state_of(ecu);
    Model *model = ecu->node.model;
    const SbPlan *plan = &ecu->plan;
    const SbState *machine = machine_of(ecu);
    const double *strain = strain_of(machine), *flow = flow_of(machine);
    double *valid_strain = (double *)(void *)((unsigned char *)s + ecu->strain_at);
    const EcuQuantity *quantity = ecu->node.table[QUANTITY], *constant = ecu->node.table[CONSTANT];
    const double cycles = isnan(s->last_step) ? 1.0 : (now - s->last_step) / plan->cycle;
    const double size = plan->cycle * (cycles <= 1.0 ? 1.0 : cycles < LONGEST_STEP ? (int32_t)(cycles + 0.5) : LONGEST_STEP);
    char text[MODEL_TEXT_SIZE];
    s->last_step = now;
    for (int32_t g = 0; g < plan->n_gauges; g++) {
        valid_strain[g] = valid_of(machine)[g] ? strain[g] : NAN;
    }
    const Selection strains = {NULL, (size_t)ecu->setup->strain, (size_t)plan->n_gauges};
    (void)model_set(model, REAL, &strains, valid_strain, text);
    for (int32_t k = 0; k < plan->n_flow; k++) {
        give(model, &quantity[k], k == plan->pressure && !isnan(plan->fixed_pressure) ? plan->fixed_pressure : flow[k]);
    }
    for (int32_t k = 0; k < count_of(ecu, CONSTANT); k++) {
        give(model, &constant[k], constant[k].value);
    }
    (void)model_step(model, s->estimator_time, s->estimator_time + size, text);
    s->estimator_time += size;
}

/* --- results -------------------------------------------------------------------------------------------------------- */

/* Loads in addition to the five, and their standard deviations. */
static void set_others(const Ecu *ecu, int published, double *value) {
    char text[MODEL_TEXT_SIZE];
    const EcuOther *load = ecu->node.table[OTHER];
    for (int64_t k = 0; k < count_of(ecu, OTHER); k++, load++) {
        const Selection which = {NULL, (size_t)load->variable, 1};
        double estimate = NAN;
        if (published) {
            (void)model_get(ecu->node.model, REAL, &which, &estimate, text);
        }
        value[k] = sent_value(estimate, load->step);
    }
}

/* The result of the machine is ready: estimate, answer, and let its frames wait. */
static void publish(Ecu *ecu) {
    State *s = state_of(ecu);
    Model *model = ecu->node.model;
    const EcuSetup *setup = ecu->setup;
    SbState *machine = machine_of(ecu);
    SbResult *r = &machine->result;
    const int n_used = r->n_used;
    const double *flow = flow_of(machine);
    const double on_bus = ecu->plan.pressure >= 0 ? flow[ecu->plan.pressure] : NAN;
    const double pressure = isnan(ecu->plan.fixed_pressure) ? on_bus : ecu->plan.fixed_pressure;
    const double time = model->time;
    const Mode mode = model->mode;
    double loads[N_REAL_LOADS], chi_square = NAN, score = NAN;
    int health = -1, is_finite = 1;
    char text[MODEL_TEXT_SIZE];
    model->mode = STEP; /* its own steps, at its own time */
    model_set_time(model, s->estimator_time);
    if (n_used) {
        const Selection first = {NULL, 0, N_REAL_LOADS}, chi = {NULL, CHI_SQUARE_OUTPUT, 1};
        const Selection margin = {NULL, ENVELOPE_OUTPUT, 1}, state = {NULL, HEALTH_OUTPUT, 1};
        step_estimator(ecu, r->time);
        (void)model_get(model, REAL, &first, loads, text);
        (void)model_get(model, REAL, &chi, &chi_square, text);
        (void)model_get(model, REAL, &margin, &score, text);
        (void)model_get(model, INTEGER, &state, &health, text);
    }
    for (int k = 0; k < N_REAL_LOADS; k++) {
        loads[k] = n_used ? loads[k] : NAN;
        is_finite = is_finite && isfinite(loads[k]);
    }
    const double release = r->time + setup->response_time;
    const int stated = health >= 0 && setup->needs_pressure && isnan(pressure) ? NO_COEFFICIENTS : health;
    const int is_sent = sb_answer(&ecu->plan, machine, &release, stated, is_finite);
    const int published = has_coefficients(r->quality);
    if (is_sent && s->n_waiting == QUEUE) {
        s->link.counter[PORT_LOST]++;
    } else if (is_sent) {
        const int place = (s->first + s->n_waiting++) % QUEUE;
        double *value = values_of(ecu, place);
        Waiting *waiting = &s->waiting[place];
        waiting->release = release;
        const SbEstimate estimate = {.loads = n_used ? loads : NULL, .chi_square = chi_square, .score = score,
                                     .pressure = pressure, .health = health, .n_gauges = n_used,
                                     .configuration = setup->configuration};
        result_values(r, &estimate, value);
        set_others(ecu, published, value + R_OTHERS);
        double *detail = waiting->detail;
        detail_values(r, detail);
        waiting->has_details = (r->causes >> 16) != 0;
        keep_last(&s->last, r, &estimate);
    }
    model->mode = mode;
    model_set_time(model, time);
}

/* What is due by now: cycles at their deadline, and silence. */
static void advance(Ecu *ecu, double time) {
    SbState *machine = machine_of(ecu);
    for (;;) {
        const double next = machine->deadline < machine->next_status ? machine->deadline : machine->next_status;
        if (next > time + TIME_ROUND_OFF) {
            return;
        }
        const double now = next > time ? next : time;
        if (sb_due(&ecu->plan, machine, &now) == SB_READY) {
            publish(ecu);
        }
    }
}

/* --- frames in ------------------------------------------------------------------------------------------------------ */

static const EcuKey *key_of(const Ecu *ecu, uint32_t key) {
    const EcuKey *known = ecu->node.table[KEY];
    for (int64_t k = 0; k < count_of(ecu, KEY); k++, known++) {
        if (known->key == key) {
            return known;
        }
    }
    return NULL;
}

static void take_frame(Ecu *ecu, const Heard *heard, double time) {
    SbState *machine = machine_of(ecu);
    const EcuKey *known = key_of(ecu, heard->key);
    if (known != NULL && known->slot < 0) {
        sb_note_bridge(machine, time + ecu->setup->bridge_alarm);
        sb_count(machine, SB_OF_SECOND_BRIDGE, time);
    } else if (known == NULL || heard->is_remote) {
        const EcuKey *of_other_width = key_of(ecu, heard->key ^ EXTENDED_FLAG);
        const int is_other = known == NULL && of_other_width != NULL && of_other_width->slot >= 0;
        sb_count(machine, known != NULL ? SB_REMOTE_FRAME : is_other ? SB_WRONG_FORMAT : SB_UNKNOWN, time);
    } else {
        int event = SB_AGAIN;
        while (event == SB_AGAIN) {
            event = sb_take(&ecu->plan, machine, known->slot, &time, heard->data, (int)heard->n,
                            heard->is_fd ? SB_FLAG_FD : 0);
            if (event == SB_READY || event == SB_AGAIN) {
                publish(ecu);
            }
        }
    }
}

/* --- frames out ----------------------------------------------------------------------------------------------------- */

/* Compose the frames of a kind with their counters, and send them. */
static void send_frames(Ecu *ecu, int kind, const double *value) {
    const SentFrame *frame = ecu->node.table[FRAME];
    const SbSignal *sent = ecu->node.table[SENT];
    const int32_t *source = ecu->node.table[SOURCE];
    uint8_t *counter = counters_of(ecu);
    for (int64_t f = 0; f < count_of(ecu, FRAME); f++, frame++, counter++) {
        double picked[MOST_SIGNALS];
        for (int32_t k = 0; frame->kind == kind && k < frame->n_signals; k++) {
            picked[k] = value[source[frame->first + k]];
        }
        if (frame->kind == kind && link_send_frame(&state_of(ecu)->link, frame, sent, picked, *counter)) {
            *counter = (uint8_t)((*counter + 1) % frame->modulus);
        }
    }
}

static void send_status(Ecu *ecu, double time) {
    State *s = state_of(ecu);
    const SbAccount *account = &machine_of(ecu)->account;
    double value[N_STATUS], detail[N_DETAILS];
    status_values(&s->last, account, time, ecu->setup->configuration, value);
    send_frames(ecu, OF_STATUS, value);
    last_details(&s->last, detail);
    send_frames(ecu, OF_DETAIL, detail);
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
    while (s->n_waiting > 0 && s->waiting[s->first].release <= time + TIME_ROUND_OFF) {
        const Waiting *waiting = &s->waiting[s->first];
        double *value = values_of(ecu, s->first);
        value[R_AGE] += time > waiting->release ? 1e3 * (time - waiting->release) : 0.0;
        send_frames(ecu, OF_RESULT, value);
        if (waiting->has_details) {
            send_frames(ecu, OF_DETAIL, waiting->detail);
        }
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
    const SbState *machine = machine_of((const Ecu *)node);
    double next = s->next_status;
    (void)port;
    next = s->n_waiting > 0 && s->waiting[s->first].release < next ? s->waiting[s->first].release : next;
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
    link->counter[PORT_USED] = (uint64_t)machine_of(ecu)->account.count[SB_USED];
}

/* --- creation and state --------------------------------------------------------------------------------------------- */

static void begin(Node *node, double time) {
    Ecu *ecu = (Ecu *)node;
    State *s = node->state;
    s->last_step = NAN;
    s->estimator_time = s->next_status = time;
    sb_begin(&ecu->plan, machine_of(ecu), time);
}

static size_t prepare(Node *node) {
    Ecu *ecu = (Ecu *)node;
    if (count_of(ecu, SETUP) != 1 || count_of(ecu, PLAN) != 1) {
        return 0;
    }
    ecu->setup = node->table[SETUP];
    memcpy(&ecu->plan, node->table[PLAN], sizeof ecu->plan);
    SbPlan *plan = &ecu->plan;
    plan->slot = node->table[SLOT];
    plan->signal = node->table[SIGNAL];
    plan->code = node->table[CODE];
    plan->change = node->table[CHANGE];
    ecu->n_values = (size_t)(R_OTHERS + count_of(ecu, OTHER));
    ecu->strain_at = sizeof(State) + QUEUE * ecu->n_values * sizeof(double);
    ecu->machine_at = ecu->strain_at + (size_t)plan->n_gauges * sizeof(double);
    ecu->counters_at = ecu->machine_at + rounded((size_t)sb_size(plan));
    const int good = plan->n_slots == count_of(ecu, SLOT) && plan->n_gauges == count_of(ecu, CHANGE)
                  && plan->n_flow == count_of(ecu, QUANTITY) && count_of(ecu, SENT) == count_of(ecu, SOURCE);
    return good ? ecu->counters_at + rounded((size_t)count_of(ecu, FRAME)) : 0;
}

static int check_state(const Node *node, const void *state) {
    const State *s = state;
    const size_t machine_at = ((const Ecu *)node)->machine_at;
    const SbState *machine = (const SbState *)(const void *)((const unsigned char *)state + machine_at);
    return s->first >= 0 && s->first < QUEUE && s->n_waiting >= 0 && s->n_waiting <= QUEUE
        && memcmp(&machine->slots_at, &machine_of((const Ecu *)node)->slots_at, 8 * sizeof machine->slots_at) == 0;
}

static const NodeKind ECU = {
    .resource = "bus.bin",
    .most_ports = 1,
    .node_size = sizeof(Ecu),
    .port_size = sizeof(Link),
    .row_size = {sizeof(EcuSetup), sizeof(SbPlan), sizeof(SbSlot), sizeof(SbSignal), sizeof(int64_t), sizeof(double),
                 sizeof(EcuKey), sizeof(EcuQuantity), sizeof(EcuQuantity), sizeof(EcuOther), sizeof(SentFrame),
                 sizeof(SbSignal), sizeof(int32_t)},
    .prepare = prepare,
    .begin = begin,
    .due = due,
    .tick = tick,
    .update = update,
    .check_state = check_state,
};

const NodeKind *const NODE_KINDS[] = {&ECU, NULL};
