/* The sender of strains as a node: readings of a plant, or of a recording, as the frames of an input, cycle by cycle.

   strainfmu/can/encoder.py in C: every signal has a source, which is a variable of the model [SI], a constant, the
   sample time, or what the sender has heard: counter and sample time of the cycle that the last result answers, and for
   how long it has been known. With them a bridge bounds the age of the strains. */

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "../bus/rounding.h"
#include "../core/floating.h"
#include "../core/resource.h"
#include "nodes.h"

enum { HEADER_OF_RESOURCE = 32, CYCLES = 256 };

#define NONE_HEARD 4294967295.0 /* sample time that stands for no result */

typedef struct {
    Link link;
    double begin, next;              /* [s] of the first cycle, of the next one */
    double sampled[CYCLES];          /* [s] by counter of the cycle */
    double heard_counter, heard_sample, heard_at; /* heard_at: NaN before the first result */
    uint64_t cycle;
} State;

typedef struct {
    Model *model;
    unsigned char *bytes;
    const SenderSetup *setup;
    const SentFrame *frame;
    const SbSignal *sent, *answer;
    const SenderSource *source;
    State state;
} Sender;

static double ticks_of(double time, double tick, const SbSignal *signal) {
    double modulus = 1.0;
    for (int32_t bit = 0; bit < signal->length; bit++) {
        modulus *= 2.0;
    }
    return remainder_of((double)whole_number(time / tick), modulus) * signal->scale + signal->offset;
}

static double value_of(const Sender *sender, const SbSignal *signal, const SenderSource *source, double time) {
    const State *s = &sender->state;
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
        (void)model_get_reals(sender->model, &which, &value, text);
        return (value - signal->added) / signal->factor;
    }
    }
}

static void send_cycle(Sender *sender, double time) {
    State *s = &sender->state;
    double value[MOST_SIGNALS];
    s->sampled[s->cycle % CYCLES] = time;
    for (int32_t f = 0; f < sender->setup->n_frames; f++) {
        const SentFrame *frame = &sender->frame[f];
        const uint64_t every = (uint64_t)frame->kind; /* in cycles */
        if (s->cycle % every != 0) {
            continue;
        }
        for (int32_t k = 0; k < frame->n_signals; k++) {
            value[k] = value_of(sender, sender->sent + frame->first + k, sender->source + frame->first + k, time);
        }
        const int counter = frame->modulus > 0 ? (int)(s->cycle / every % (uint64_t)frame->modulus) : -1;
        link_send_frame(&s->link, frame, sender->sent, value, counter);
    }
    s->cycle++;
    const double periods = (double)(int64_t)((time - s->begin) / sender->setup->period + 1e-6) + 1.0;
    s->next = s->begin + periods * sender->setup->period;
}

static void tick(void *of, size_t port, double time) {
    Sender *sender = of;
    (void)port;
    if (link_tick(&sender->state.link, sender->setup->can_rate, sender->setup->fd_rate)
        && sender->state.next <= time + TIME_ROUND_OFF) {
        const Floating host = floating_enter();
        send_cycle(sender, time);
        floating_leave(&host);
    }
}

/* A result: which cycle it answers. */
static void take_answer(Sender *sender, const Heard *heard, double time) {
    const SenderSetup *e = sender->setup;
    State *s = &sender->state;
    int64_t raw[3] = {0, 0, 0};
    if (!heard->is_frame || heard->key != e->answer_key || heard->n != (size_t)e->answer_length) {
        return;
    }
    sb_raw(sender->answer, e->n_answer, heard->data, raw);
    if ((e->n_answer > 2 && raw[2] == sender->answer[2].none) || s->cycle <= (uint64_t)raw[0]) {
        return;
    }
    s->heard_counter = (double)raw[1];
    s->heard_sample = s->sampled[raw[0] % CYCLES];
    s->heard_at = time;
    s->link.counter[PORT_USED]++;
}

static void update(void *of, double time) {
    Sender *sender = of;
    Heard heard;
    link_end_tick(&sender->state.link);
    for (size_t at = 0; link_next(&sender->state.link, &at, &heard);) {
        take_answer(sender, &heard, time);
    }
}

static double due(const void *of, size_t port) {
    const State *s = &((const Sender *)of)->state;
    (void)port;
    return s->link.has_begun && s->link.n_reply == 0 ? s->next : -INFINITY;
}

static Link *link_of(const void *of, size_t port) {
    return port == 0 ? &((Sender *)(uintptr_t)of)->state.link : NULL;
}

static int is_triggered(const void *node) {
    return ((const Sender *)node)->setup->is_triggered;
}

static void begin(void *of, double time) {
    State *s = &((Sender *)of)->state;
    memset(s, 0, sizeof *s);
    s->begin = s->next = time;
    s->heard_at = NAN;
}

static void destroy(void *of) {
    free(((Sender *)of)->bytes);
    free(of);
}

static int read_setup(Sender *sender, size_t length) {
    const unsigned char *b = sender->bytes;
    const SenderSetup *e = (const SenderSetup *)(const void *)(b + HEADER_OF_RESOURCE);
    sender->setup = e;
    return length >= HEADER_OF_RESOURCE + sizeof *e
        && array_of(b, length, e->frame, e->n_frames, sizeof(SentFrame), (const void **)&sender->frame)
        && array_of(b, length, e->sent, e->n_sent, sizeof(SbSignal), (const void **)&sender->sent)
        && array_of(b, length, e->source, e->n_sent, sizeof(SenderSource), (const void **)&sender->source)
        && array_of(b, length, e->answer, e->n_answer, sizeof(SbSignal), (const void **)&sender->answer)
        && memchr(e->guid, 0, sizeof e->guid) != NULL && strcmp(e->guid, sender->model->guid) == 0;
}

static void *create(Model *model, unsigned char *bytes, size_t length, char text[MODEL_TEXT_SIZE]) {
    Sender *sender = resource_check(bytes, length, "SFMUSEN", SENDER_VERSION, "sender", text) ? calloc(1, sizeof *sender) : NULL;
    if (sender == NULL) {
        free(bytes);
        return NULL;
    }
    sender->model = model;
    sender->bytes = bytes;
    if (!read_setup(sender, length)) {
        snprintf(text, MODEL_TEXT_SIZE, "is not the sender of this FMU");
        destroy(sender);
        return NULL;
    }
    return sender;
}

static void *state(const void *of, size_t *size) {
    *size = sizeof(State);
    return &((Sender *)(uintptr_t)of)->state;
}

static int check_state(const void *of, const unsigned char *bytes, char text[MODEL_TEXT_SIZE]) {
    State s;
    (void)of;
    memcpy(&s, bytes, sizeof s);
    if (!link_check(&s.link)) {
        snprintf(text, MODEL_TEXT_SIZE, "holds frames that cannot be");
        return 0;
    }
    return 1;
}

const Ports SENDER = {
    .resource = "sender.bin",
    .steps_model = 1,
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

const Ports *const PORTS[] = {&SENDER, &CAN_BUS, NULL};
