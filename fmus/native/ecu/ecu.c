/* The estimator as an ECU on a CAN bus: strain frames in, result frames out.

   The bridge's state machine (bus/) takes the frames in; here are what the bridge does around it in Python: estimator
   steps of whole cycles (strainfmu/can/machine.py), and the composition of result and status frames
   (strainfmu/can/result_frames.py). A result waits for `response_time`; it goes out with the first tick after that,
   and is sealed there: its age grows until the tick, its counter and CRC are those of the sending.

   All memory of a node lies in one block without pointers behind `State`: the state of the FMU is a copy of it. */

#include "ecu.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "../core/floating.h"
#include "../core/resource.h"

#define HEADER_SIZE_OF_RESOURCE 32
#define LARGEST_UNCERTAINTY 6553.4
#define LARGEST_SCORE 25.4
#define LONGEST_STEP 100   /* cycles in one step of the estimator */

enum { QUEUE = 16, N_LOADS_SENT = 5, NO_COEFFICIENTS = 2 };

/* Numbers of FMI 2.0 of outputs of the estimator: estimator/sample/outputs.h. */
enum { HEALTH_OUTPUT = 20, CHI_SQUARE_OUTPUT = 21, ENVELOPE_OUTPUT = 26, N_REAL_LOADS = 10 };

/* Values of the frames of a result, of the details and of the status, as result_frames.py lists them. */
enum {
    R_COEFFICIENTS = 2, R_SIGMA = 7, R_QUALITY = 12, R_HEALTH, R_USABLE, R_SAMPLE_TIME, R_CHI_SQUARE, R_AGE, R_CAUSES,
    R_GAUGES, R_ANSWERED, R_CONFIGURATION, R_PRESSURE, R_SCORE, R_OTHERS
};
enum { D_QUALITY = 2, D_CAUSES, D_USABLE, D_UNCERTAINTY, D_ANSWERED, N_DETAILS };
enum { S_LAST = 2, S_COUNTS = 7, S_COUNTS_16 = 12, S_AGE = 17, S_AGE_16, S_QUALITY, S_BUS, S_FAILURES, S_REOPENED, S_DRIFT,
       S_SCORE, S_CONFIGURATION, N_STATUS };

/* A result that waits for its tick; its values lie behind the state. */
typedef struct {
    double release; /* [s] */
    double detail[N_DETAILS];
    int32_t has_details, padding;
} Waiting;

typedef struct {
    Link link;
    double estimator_time, last_step, next_status; /* [s]; last_step NaN before the first */
    double last[N_LOADS_SENT], last_ready, last_age, score; /* of the last valid result; of the last one */
    double detail[N_DETAILS];
    uint64_t results;
    int32_t has_last, has_valid, first, n_waiting;
    Waiting waiting[QUEUE];
} State;

typedef struct {
    Model *model;
    unsigned char *bytes;
    const EcuSetup *setup;
    SbPlan plan;
    State *state;
    size_t n_values, size, machine_at, counters_at; /* of the block */
    double *strain;
    const EcuKey *key;
    const EcuQuantity *quantity, *constant;
    const EcuOther *other;
    const SentFrame *frame;
    const SbSignal *sent;
    const int32_t *source;
} Node;

static SbState *machine_of(const Node *node) {
    return (SbState *)(void *)((unsigned char *)node->state + node->machine_at);
}

static double *values_of(const Node *node, int waiting) {
    return (double *)(void *)(node->state + 1) + node->n_values * (size_t)waiting;
}

static uint8_t *counters_of(const Node *node) {
    return (uint8_t *)node->state + node->counters_at;
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
        (void)model_set_integers(model, &which, &number, text);
        return;
    }
    const double given = !isnan(to->fallback) && !(value > 0.0) ? to->fallback : value;
    (void)model_set_reals(model, &which, &given, text);
}

/* Step by whole cycles, with the strains and the flow of the result that is ready. */
static void step_estimator(Node *node, double now) {
    State *s = node->state;
    Model *model = node->model;
    const SbPlan *plan = &node->plan;
    const SbState *machine = machine_of(node);
    const double *strain = strain_of(machine), *flow = flow_of(machine);
    const double cycles = isnan(s->last_step) ? 1.0 : (now - s->last_step) / plan->cycle;
    const double size = plan->cycle * (cycles <= 1.0 ? 1.0 : cycles < LONGEST_STEP ? (int32_t)(cycles + 0.5) : LONGEST_STEP);
    char text[MODEL_TEXT_SIZE];
    s->last_step = now;
    for (int32_t g = 0; g < plan->n_gauges; g++) {
        node->strain[g] = valid_of(machine)[g] ? strain[g] : NAN;
    }
    const Selection strains = {NULL, (size_t)node->setup->strain, (size_t)plan->n_gauges};
    (void)model_set_reals(model, &strains, node->strain, text);
    for (int32_t k = 0; k < plan->n_flow; k++) {
        give(model, &node->quantity[k], k == plan->pressure && !isnan(plan->fixed_pressure) ? plan->fixed_pressure : flow[k]);
    }
    for (int32_t k = 0; k < node->setup->n_constants; k++) {
        give(model, &node->constant[k], node->constant[k].value);
    }
    (void)model_step(model, s->estimator_time, s->estimator_time + size, text);
    s->estimator_time += size;
}

/* --- results -------------------------------------------------------------------------------------------------------- */

static int has_coefficients(int quality) {
    return quality == SB_VALID || quality == SB_UNPROTECTED || quality == SB_DEGRADED || quality == SB_SUSPECT ||
           quality == SB_UNCONFIRMED;
}

static double at_most(double value, double largest) {
    return value > largest ? largest : value;
}

/* The smallest whole number that is not below x, for x from 0 to 65534. */
static double whole_above(double x) {
    const double whole = (double)(int32_t)x;
    return whole < x ? whole + 1.0 : whole;
}

/* Loads in addition to the five, and their standard deviations, which are never stated smaller than they are. */
static void set_others(const Node *node, int published, double *value) {
    char text[MODEL_TEXT_SIZE];
    for (int32_t k = 0; k < node->setup->n_others; k++) {
        const EcuOther *one = &node->other[k];
        const Selection which = {NULL, (size_t)one->variable, 1};
        double found = NAN;
        if (published) {
            (void)model_get_reals(node->model, &which, &found, text);
        }
        const double steps = found / one->step;
        value[k] = one->step == 0.0 ? found : steps >= 0.0 && steps <= 65534.0 ? one->step * whole_above(steps) : NAN;
    }
}

/* The result of the machine is ready: estimate, answer, and let its frames wait. */
static void publish(Node *node) {
    State *s = node->state;
    Model *model = node->model;
    const EcuSetup *setup = node->setup;
    SbState *machine = machine_of(node);
    SbResult *r = &machine->result;
    const int is_silent = r->is_silent, n_used = r->n_used;
    const double *flow = flow_of(machine);
    const double on_bus = node->plan.pressure >= 0 ? flow[node->plan.pressure] : NAN;
    const double pressure = isnan(node->plan.fixed_pressure) ? on_bus : node->plan.fixed_pressure;
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
        step_estimator(node, r->time);
        (void)model_get_reals(model, &first, loads, text);
        (void)model_get_reals(model, &chi, &chi_square, text);
        (void)model_get_reals(model, &margin, &score, text);
        (void)model_get_integers(model, &state, &health, text);
    }
    for (int k = 0; k < N_REAL_LOADS; k++) {
        loads[k] = n_used ? loads[k] : NAN;
        is_finite = is_finite && isfinite(loads[k]);
    }
    const double release = r->time + setup->response_time;
    const int stated = health >= 0 && setup->needs_pressure && isnan(pressure) ? NO_COEFFICIENTS : health;
    const int is_sent = sb_answer(&node->plan, machine, &release, stated, is_finite);
    const int published = has_coefficients(r->quality);
    if (is_sent && s->n_waiting == QUEUE) {
        s->link.counter[PORT_LOST]++;
    } else if (is_sent) {
        const int place = (s->first + s->n_waiting++) % QUEUE;
        double *value = values_of(node, place);
        Waiting *waiting = &s->waiting[place];
        waiting->release = release;
        for (int k = 0; k < N_LOADS_SENT; k++) {
            value[R_COEFFICIENTS + k] = published ? loads[k] : NAN;
            value[R_SIGMA + k] = published ? loads[N_LOADS_SENT + k] : NAN;
        }
        value[0] = value[1] = 0.0; /* CRC and counter are written last */
        value[R_QUALITY] = r->quality;
        value[R_HEALTH] = health < 0 ? NAN : health;
        value[R_USABLE] = r->usable;
        value[R_SAMPLE_TIME] = r->sample_time < 0 ? NAN : (double)r->sample_time;
        value[R_CHI_SQUARE] = chi_square;
        value[R_AGE] = 1e3 * r->age;
        value[R_CAUSES] = (double)((r->causes & 0x7FFFu) | (r->causes >> 16 ? 0x8000u : 0u));
        value[R_GAUGES] = at_most(n_used, 255.0);
        value[R_ANSWERED] = r->counter < 0 ? 0.0 : r->counter;
        value[R_CONFIGURATION] = setup->configuration;
        value[R_PRESSURE] = is_silent ? NAN : pressure;
        value[R_SCORE] = at_most(score, LARGEST_SCORE);
        set_others(node, published, value + R_OTHERS);
        double *detail = waiting->detail;
        detail[0] = detail[1] = 0.0;
        detail[D_QUALITY] = r->quality;
        detail[D_CAUSES] = r->causes;
        detail[D_USABLE] = r->usable;
        detail[D_UNCERTAINTY] = at_most(1e3 * r->uncertainty, LARGEST_UNCERTAINTY);
        detail[D_ANSWERED] = value[R_ANSWERED];
        waiting->has_details = (r->causes >> 16) != 0;
        memcpy(s->detail, detail, sizeof s->detail);
        s->score = score;
        s->has_last = 1;
        s->results++;
        if (r->quality == SB_VALID || r->quality == SB_UNPROTECTED) {
            memcpy(s->last, loads, sizeof s->last);
            s->has_valid = 1;
            s->last_ready = r->time;
            s->last_age = r->age;
        }
    }
    model->mode = mode;
    model_set_time(model, time);
}

/* What is due by now: cycles at their deadline, and silence. */
static void advance(Node *node, double time) {
    SbState *machine = machine_of(node);
    for (;;) {
        const double next = machine->deadline < machine->next_status ? machine->deadline : machine->next_status;
        if (next > time + TIME_ROUND_OFF) {
            return;
        }
        const double now = next > time ? next : time;
        if (sb_due(&node->plan, machine, &now) == SB_READY) {
            publish(node);
        }
    }
}

/* --- frames in ------------------------------------------------------------------------------------------------------ */

static const EcuKey *key_of(const Node *node, uint32_t key) {
    for (int32_t k = 0; k < node->setup->n_keys; k++) {
        if (node->key[k].key == key) {
            return &node->key[k];
        }
    }
    return NULL;
}

static void take_frame(Node *node, const Heard *heard, double time) {
    SbState *machine = machine_of(node);
    const EcuKey *known = key_of(node, heard->key);
    if (known != NULL && known->slot < 0) {
        sb_note_bridge(machine, time + node->setup->bridge_alarm);
        sb_count(machine, SB_OF_SECOND_BRIDGE, time);
    } else if (known == NULL || heard->is_remote) {
        const EcuKey *of_other_width = key_of(node, heard->key ^ EXTENDED_FLAG);
        const int is_other = known == NULL && of_other_width != NULL && of_other_width->slot >= 0;
        sb_count(machine, known != NULL ? SB_REMOTE_FRAME : is_other ? SB_WRONG_FORMAT : SB_UNKNOWN, time);
    } else {
        int event = SB_AGAIN;
        while (event == SB_AGAIN) {
            event = sb_take(&node->plan, machine, known->slot, &time, heard->data, (int)heard->n,
                            heard->is_fd ? SB_FLAG_FD : 0);
            if (event == SB_READY || event == SB_AGAIN) {
                publish(node);
            }
        }
    }
}

/* --- frames out ----------------------------------------------------------------------------------------------------- */

/* Compose the frames of a kind with their counters, and send them. */
static void send_frames(Node *node, int kind, const double *value) {
    for (int32_t f = 0; f < node->setup->n_frames; f++) {
        const SentFrame *frame = &node->frame[f];
        uint8_t *counter = counters_of(node) + f;
        double picked[MOST_SIGNALS];
        for (int32_t k = 0; frame->kind == kind && k < frame->n_signals; k++) {
            picked[k] = value[node->source[frame->first + k]];
        }
        if (frame->kind == kind && link_send_frame(&node->state->link, frame, node->sent, picked, *counter)) {
            *counter = (uint8_t)((*counter + 1) % frame->modulus);
        }
    }
}

static void send_status(Node *node, double time) {
    State *s = node->state;
    const SbAccount *account = &machine_of(node)->account;
    double value[N_STATUS] = {0.0};
    int64_t rejected = 0;
    for (int k = 0; k < SB_N_CLASSES; k++) {
        rejected += k == SB_USED ? 0 : account->count[k];
    }
    const int64_t count[] = {account->received, account->count[SB_USED], rejected, (int64_t)s->results, account->count[SB_OVERRUN]};
    for (int k = 0; k < 5; k++) {
        value[S_LAST + k] = s->has_valid ? s->last[k] : NAN;
        value[S_COUNTS + k] = (double)((uint64_t)count[k] & 0xFFFFFFFFu);
        value[S_COUNTS_16 + k] = (double)((uint64_t)count[k] & 0xFFFFu);
    }
    const double age = s->has_valid ? 1e3 * (time - s->last_ready + s->last_age) : NAN;
    value[S_AGE] = at_most(age, 4294967294.0);
    value[S_AGE_16] = at_most(age, 655340.0);
    value[S_QUALITY] = s->has_last ? s->detail[D_QUALITY] : SB_NO_DATA;
    value[S_DRIFT] = NAN;
    value[S_SCORE] = s->has_last ? s->score : NAN;
    value[S_CONFIGURATION] = node->setup->configuration;
    send_frames(node, OF_STATUS, value);
    double detail[N_DETAILS] = {0.0};
    detail[D_UNCERTAINTY] = NAN;
    if (s->has_last) {
        memcpy(detail, s->detail, sizeof detail);
    }
    send_frames(node, OF_DETAIL, detail);
    s->next_status += node->setup->status_period;
    s->next_status = s->next_status > time ? s->next_status : time;
}

static void tick(void *of, size_t port, double time) {
    Node *node = of;
    State *s = node->state;
    (void)port;
    if (!link_tick(&s->link, node->setup->can_rate, node->setup->fd_rate)) {
        return;
    }
    const Floating host = floating_enter();
    advance(node, time);
    while (s->n_waiting > 0 && s->waiting[s->first].release <= time + TIME_ROUND_OFF) {
        const Waiting *waiting = &s->waiting[s->first];
        double *value = values_of(node, s->first);
        value[R_AGE] += time > waiting->release ? 1e3 * (time - waiting->release) : 0.0;
        send_frames(node, OF_RESULT, value);
        if (waiting->has_details) {
            send_frames(node, OF_DETAIL, waiting->detail);
        }
        s->first = (s->first + 1) % QUEUE;
        s->n_waiting--;
    }
    if (s->next_status <= time + TIME_ROUND_OFF) {
        send_status(node, time);
    }
    floating_leave(&host);
}

static double due(const void *of, size_t port) {
    const Node *node = of;
    const State *s = node->state;
    const SbState *machine = machine_of(node);
    double next = s->next_status;
    (void)port;
    next = s->n_waiting > 0 && s->waiting[s->first].release < next ? s->waiting[s->first].release : next;
    next = machine->deadline < next ? machine->deadline : next;
    next = machine->next_status < next ? machine->next_status : next;
    return s->link.has_begun && s->link.n_reply == 0 ? next : -INFINITY;
}

static void update(void *of, double time) {
    Node *node = of;
    Link *link = &node->state->link;
    Heard heard;
    link_end_tick(link);
    if (link->n_heard > 0) {
        advance(node, time);
    }
    for (size_t at = 0; link_next(link, &at, &heard);) {
        if (heard.is_frame) {
            take_frame(node, &heard, time);
        }
    }
    link->counter[PORT_USED] = (uint64_t)machine_of(node)->account.count[SB_USED];
}

static Link *link_of(const void *node, size_t port) {
    return port == 0 ? &((const Node *)node)->state->link : NULL;
}

static int is_triggered(const void *node) {
    return ((const Node *)node)->setup->is_triggered;
}

/* --- creation and state --------------------------------------------------------------------------------------------- */

static void destroy(void *of) {
    Node *node = of;
    if (node != NULL) {
        free(node->state);
        free(node->strain);
        free(node->bytes);
        free(node);
    }
}

static void begin(void *of, double time) {
    Node *node = of;
    State *s = node->state;
    memset(s, 0, node->size);
    s->last_step = s->score = NAN;
    s->estimator_time = s->next_status = time;
    for (int32_t f = 0; f < node->setup->n_frames; f++) {
        counters_of(node)[f] = (uint8_t)(node->setup->first_result % node->frame[f].modulus);
    }
    sb_begin(&node->plan, machine_of(node), time);
}

static int read_setup(Node *node, size_t length) {
    const EcuSetup *e = (const EcuSetup *)(const void *)(node->bytes + HEADER_SIZE_OF_RESOURCE);
    const void *plan, *slot = NULL, *signal = NULL, *code = NULL, *change = NULL;
    node->setup = e;
    if (length < HEADER_SIZE_OF_RESOURCE + sizeof *e || !array_of(node->bytes, length, e->plan, 1, sizeof(SbPlan), &plan)) {
        return 0;
    }
    memcpy(&node->plan, plan, sizeof node->plan);
    const SbPlan *p = &node->plan;
    const unsigned char *b = node->bytes;
    const int good = array_of(b, length, e->slot, p->n_slots, sizeof(SbSlot), &slot)
                  && array_of(b, length, e->signal, e->n_signals, sizeof(SbSignal), &signal)
                  && array_of(b, length, e->code, e->n_codes, sizeof(int64_t), &code)
                  && array_of(b, length, e->change, p->n_gauges, sizeof(double), &change)
                  && array_of(b, length, e->key, e->n_keys, sizeof(EcuKey), (const void **)&node->key)
                  && array_of(b, length, e->quantity, p->n_flow, sizeof(EcuQuantity), (const void **)&node->quantity)
                  && array_of(b, length, e->constant, e->n_constants, sizeof(EcuQuantity), (const void **)&node->constant)
                  && array_of(b, length, e->other, e->n_others, sizeof(EcuOther), (const void **)&node->other)
                  && array_of(b, length, e->frame, e->n_frames, sizeof(SentFrame), (const void **)&node->frame)
                  && array_of(b, length, e->sent, e->n_sent, sizeof(SbSignal), (const void **)&node->sent)
                  && array_of(b, length, e->source, e->n_sent, sizeof(int32_t), (const void **)&node->source);
    node->plan.slot = slot;
    node->plan.signal = signal;
    node->plan.code = code;
    node->plan.change = change;
    return good && memchr(e->guid, 0, sizeof e->guid) != NULL;
}

static int allocate(Node *node) {
    const EcuSetup *e = node->setup;
    node->n_values = (size_t)(R_OTHERS + e->n_others);
    node->machine_at = rounded(sizeof(State)) + QUEUE * node->n_values * sizeof(double);
    node->counters_at = node->machine_at + rounded((size_t)sb_size(&node->plan));
    node->size = node->counters_at + rounded((size_t)e->n_frames);
    node->state = calloc(1, node->size);
    node->strain = calloc((size_t)node->plan.n_gauges + 1, sizeof *node->strain);
    return node->state != NULL && node->strain != NULL;
}

static void *create(Model *model, unsigned char *bytes, size_t length, char text[MODEL_TEXT_SIZE]) {
    Node *node = calloc(1, sizeof *node);
    if (node == NULL) {
        free(bytes);
        snprintf(text, MODEL_TEXT_SIZE, "needs more memory than there is");
        return NULL;
    }
    node->bytes = bytes;
    node->model = model;
    if (!resource_check(bytes, length, "SFMUBUS", ECU_VERSION, "bus", text)) {
        destroy(node);
        return NULL;
    }
    if (!read_setup(node, length) || strcmp(node->setup->guid, model->guid) != 0 || !allocate(node)) {
        snprintf(text, MODEL_TEXT_SIZE, "is not the bus of this FMU");
        destroy(node);
        return NULL;
    }
    begin(node, 0.0);
    return node;
}

static void *state(const void *of, size_t *size) {
    const Node *node = of;
    *size = node->size;
    return node->state;
}

static int check_state(const void *of, const unsigned char *bytes, char text[MODEL_TEXT_SIZE]) {
    const Node *node = of;
    State s;
    SbState machine;
    memcpy(&s, bytes, sizeof s);
    memcpy(&machine, bytes + node->machine_at, sizeof machine);
    const int good = link_check(&s.link) && s.first >= 0 && s.first < QUEUE && s.n_waiting >= 0 && s.n_waiting <= QUEUE
                  && memcmp(&machine.slots_at, &machine_of(node)->slots_at, 8 * sizeof machine.slots_at) == 0;
    if (!good) {
        snprintf(text, MODEL_TEXT_SIZE, "holds frames that cannot be");
    }
    return good;
}

static const Ports ECU = {
    .resource = "bus.bin",
    .create = create,
    .destroy = destroy,
    .begin = begin,
    .is_triggered = is_triggered,
    .link = link_of,
    .due = due,
    .tick = tick,
    .update = update,
    .state = state,
    .check_state = check_state,
};

const Ports *const PORTS[] = {&ECU, NULL};
