/* The sender of strains as a node: readings of a plant, or of a recording, as the frames of an input, cycle by cycle.

   strainfmu/can/encoder.py in C: every signal has a source, which is a variable of the model [SI], a constant, the
   sample time, or what the sender has heard: counter and sample time of the cycle that the last result answers, and for
   how long it has been known. With them a bridge bounds the age of the strains. */

#include <math.h>

#include "../bus/rounding.h"
#include "../core/floating.h"
#include "../network/link.h"

enum { CYCLES = 256 };

/* Where the value of a signal comes from: a variable of the model, by its number, or one of these. */
enum { CONSTANT = -1, SAMPLE_TIME = -2, HEARD_COUNTER = -3, HEARD_TIME = -4, HEARD_DELAY = -5 };

/* `value`: of a constant in its signal's unit; of times the unit of the raw number [s]. */
typedef struct {
    int32_t from, padding;
    double value;
} SenderSource;

/* The tables of resources/sender.bin, as strainfmu/packaging/nodes.py writes them: set-up; frames, their signals and sources;
   and of the answer the signals of: counter of the cycle that it answers, its own counter, its sample time if any. */
enum { SETUP, FRAME, SENT, SOURCE, ANSWER };

typedef struct {
    double period; /* [s] */
    uint32_t answer_key;
    int32_t answer_length;
} SenderSetup;

#define NONE_HEARD 4294967295.0 /* sample time that stands for no result */

typedef struct {
    Link link;
    double begin, next;              /* [s] of the first cycle, of the next one */
    double sampled[CYCLES];          /* [s] by counter of the cycle */
    double heard_counter, heard_sample, heard_at; /* heard_at: NaN before the first result */
    uint64_t cycle;
} State;

static const SenderSetup *setup_of(const Node *sender) {
    return sender->table[SETUP];
}

static double ticks_of(double time, double tick, const SbSignal *signal) {
    const double ticks = remainder_of((double)whole_number(time / tick), power_of_two(signal->length));
    return ticks * signal->scale + signal->offset;
}

static double value_of(const Node *sender, const SbSignal *signal, const SenderSource *source, double time) {
    const State *s = sender->state;
    const int has_heard = !isnan(s->heard_at);
    switch (source->from) {
    case CONSTANT: return source->value;
    case SAMPLE_TIME: return ticks_of(time, source->value, signal);
    case HEARD_COUNTER: return s->heard_counter;
    case HEARD_TIME: return has_heard ? ticks_of(s->heard_sample, source->value, signal) : NONE_HEARD;
    case HEARD_DELAY: {
        const double steps = (double)(int64_t)(1e3 * (time - s->heard_at) / signal->scale); /* for that long at least */
        const double longest = (double)(signal->none - 1);
        return !has_heard ? NAN : signal->scale * (steps < longest ? steps : longest);
    }
    default: {
        char text[MODEL_TEXT_SIZE];
        const Selection which = {NULL, (size_t)source->from, 1};
        double value = NAN;
        (void)model_get(sender->model, REAL, &which, &value, text);
        return (value - signal->added) / signal->factor;
    }
    }
}

static void send_cycle(Node *sender, double time) {
    State *s = sender->state;
    const SentFrame *frame = sender->table[FRAME];
    const SbSignal *sent = sender->table[SENT];
    const SenderSource *source = sender->table[SOURCE];
    const double period = setup_of(sender)->period;
    double value[MOST_SIGNALS];
    uint8_t data[MOST_BYTES];
    s->sampled[s->cycle % CYCLES] = time;
    for (int64_t f = 0; f < sender->setup->table[FRAME].count; f++, frame++) {
        const uint64_t every = (uint64_t)frame->kind; /* in cycles */
        if (s->cycle % every != 0) {
            continue;
        }
        for (int32_t k = 0; k < frame->n_signals; k++) {
            value[k] = value_of(sender, sent + frame->first + k, source + frame->first + k, time);
        }
        const int counter = frame->modulus > 0 ? (int)(s->cycle / every % (uint64_t)frame->modulus) : -1;
        if (sb_encode(sent + frame->first, frame->n_signals, value, counter, &frame->protection, data, frame->length) < 0) {
            link_send_frame(&s->link, frame, data);
        } else {
            s->link.counter[PORT_LOST]++;
        }
    }
    s->cycle++;
    const double periods = (double)(int64_t)((time - s->begin) / period + 1e-6) + 1.0;
    s->next = s->begin + periods * period;
}

static void tick(Node *sender, size_t port, double time) {
    State *s = sender->state;
    (void)port;
    if (link_tick(&s->link, sender->setup) && s->next <= time + TIME_ROUND_OFF) {
        const Floating host = floating_enter();
        send_cycle(sender, time);
        floating_leave(&host);
    }
}

/* Whether a result states the sample time of a cycle, where it states any: one that comes after CYCLES answers an earlier one. */
static int is_of_cycle(const Node *sender, double sampled, int64_t stated) {
    const SbSignal *sent = sender->table[SENT];
    const SenderSource *source = sender->table[SOURCE];
    for (int64_t k = 0; k < sender->setup->table[SOURCE].count; k++) {
        if (source[k].from == SAMPLE_TIME) {
            return ticks_of(sampled, source[k].value, sent + k) == (double)stated;
        }
    }
    return 0;
}

/* A result: which cycle it answers. */
static void take_answer(Node *sender, const Heard *heard, double time) {
    const SenderSetup *e = setup_of(sender);
    const SbSignal *answer = sender->table[ANSWER];
    const int n_answer = (int)sender->setup->table[ANSWER].count;
    State *s = sender->state;
    int64_t raw[3] = {0, 0, 0};
    if (!heard->is_frame || heard->key != e->answer_key || heard->n != (size_t)e->answer_length) {
        return;
    }
    sb_raw(answer, n_answer, heard->data, raw);
    if ((n_answer > 2 && raw[2] == answer[2].none) || s->cycle <= (uint64_t)raw[0]) {
        return;
    }
    const double sampled = s->sampled[raw[0] % CYCLES];
    if (n_answer > 2 && !is_of_cycle(sender, sampled, raw[2])) {
        return;
    }
    s->heard_counter = (double)raw[1];
    s->heard_sample = sampled;
    s->heard_at = time;
    s->link.counter[PORT_USED]++;
}

static void update(Node *sender, double time) {
    State *s = sender->state;
    Heard heard;
    link_end_tick(&s->link);
    for (size_t at = 0; link_next(&s->link, &at, &heard);) {
        take_answer(sender, &heard, time);
    }
}

static double due(const Node *sender, size_t port) {
    (void)port;
    return ((const State *)sender->state)->next;
}

static size_t prepare(Node *sender) {
    const NodeSetup *e = sender->setup;
    const int good = e->table[SETUP].count == 1 && e->table[SENT].count == e->table[SOURCE].count
                  && e->table[ANSWER].count <= 3;
    return good ? sizeof(State) : 0;
}

static void begin(Node *sender, double time) {
    State *s = sender->state;
    s->begin = s->next = time;
    s->heard_at = NAN;
}

const NodeKind SENDER = {
    .resource = "sender.bin",
    .steps_model = 1,
    .most_ports = 1,
    .node_size = sizeof(Node),
    .port_size = sizeof(Link),
    .row_size = {sizeof(SenderSetup), sizeof(SentFrame), sizeof(SbSignal), sizeof(SenderSource), sizeof(SbSignal)},
    .prepare = prepare,
    .begin = begin,
    .due = due,
    .tick = tick,
    .update = update,
};

const NodeKind *const NODE_KINDS[] = {&SENDER, &CAN_BUS, NULL};
