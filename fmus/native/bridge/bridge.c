/* What a bridge does in every cycle around the machine: a step of the estimator, an FMU of FMI 2.0, with the strains and
   the flow of the result that is ready; its answer; and the frames of the result. */

#include <math.h>
#include <string.h>

#include "../bus/rounding.h"
#include "bridge.h"

enum { LONGEST_STEP = 100, NO_COEFFICIENTS = 2, CHI_SQUARE = N_REAL_LOADS };

void sb_bridge_sizes(int64_t size[6]) {
    size[0] = sizeof(SentFrame);
    size[1] = sizeof(SbBridge);
    size[2] = sizeof(SbEstimator);
    size[3] = sizeof(SbExchange);
    size[4] = sizeof(SbLogged);
    size[5] = sizeof(SbQueue);
}

/* --- frames in ------------------------------------------------------------------------------------------------------- */

void sb_log(SbQueue *queue, const SbLogged *frame, const uint8_t *data) {
    SbQueue *q = queue;
    if (q->put - q->taken >= q->room) {
        q->lost++;
        return;
    }
    SbLogged *kept = &q->frame[q->put % q->size];
    const size_t n = frame->n < MOST_BYTES ? frame->n : MOST_BYTES;
    *kept = *frame;
    memcpy(kept->data, data, n);
    memset(kept->data + n, 0, MOST_BYTES - n);
    q->put++;
}

int sb_hear(SbBridge *bridge, const uint8_t *data) {
    const SbBridge *b = bridge;
    const SbLogged *h = b->heard;
    for (int32_t k = 0; k < b->n_keys && !(h->flags & (SB_IS_ERROR | SB_IS_REMOTE)); k++) {
        if (b->key[k] != h->key) {
            continue;
        }
        const int flags = (h->flags & SB_IS_FD ? SB_FLAG_FD : 0) | h->verdict;
        const int event = sb_take(b->plan, b->state, b->slot[k], &h->time, data, h->n, flags);
        if (b->queue != NULL && (event == SB_TAKEN || event == SB_READY)) {
            sb_log(b->queue, h, data);
        }
        b->has_come[k] = 1;
        return event;
    }
    return SB_OTHER;
}

/* --- the estimator -------------------------------------------------------------------------------------------------- */

/* Put inputs into what a call reads; 0 if whole numbers are those that were given last. */
static int gather(SbExchange *x, const double *input) {
    int is_new = !x->is_whole || !x->is_given;
    for (int32_t k = 0; x->place != NULL && k < x->n; k++) {
        const double number = input[x->place[k]];
        if (!x->is_whole) {
            ((double *)x->value)[k] = number;
            continue;
        }
        int32_t *whole = (int32_t *)x->value + k;
        const int32_t next = number > -2147483648.0 && number < 2147483648.0 ? (int32_t)number : 0;
        is_new |= *whole != next;
        *whole = next;
    }
    return is_new;
}

static int exchange_all(SbEstimator *e, int is_output) {
    for (int32_t i = 0; i < e->n_exchanges; i++) {
        SbExchange *x = &e->exchange[i];
        if (x->is_output != is_output || (!is_output && !gather(x, e->input))) {
            continue;
        }
        const int status = x->move(e->component, x->reference, (size_t)x->n, x->value);
        if (status > 1) {
            return 8 * i + status;
        }
        x->is_given = 1;
        for (int32_t k = 0; is_output && x->place != NULL && k < x->n; k++) {
            e->output[x->place[k]] = x->is_whole ? ((int32_t *)x->value)[k] : ((double *)x->value)[k];
        }
    }
    return 0;
}

int sb_step(SbEstimator *estimator, const double *size) {
    SbEstimator *e = estimator;
    const double begin = e->time;
    for (int32_t k = 0; k < e->n_angles; k++) {
        double *std = &e->input[e->angle[k]];
        *std = *std > 0.0 ? *std : e->angle_error;
    }
    e->time = begin + *size;
    int failed = exchange_all(e, 0);
    if (!failed) {
        const int status = e->step(e->component, begin, *size, 1);
        failed = status > 1 ? 8 * e->n_exchanges + status : 0;
    }
    return failed ? failed : exchange_all(e, 1);
}

int sb_estimate(SbBridge *bridge) {
    SbBridge *b = bridge;
    const SbPlan *p = b->plan;
    const SbState *s = b->state;
    const SbResult *r = &s->result;
    const double *flow = flow_of(s);
    const double fixed = p->fixed_pressure;
    b->pressure = !isnan(fixed) ? fixed : p->pressure >= 0 ? flow[p->pressure] : NAN;
    b->n_gauges = r->n_used;
    b->is_stepped = 0;
    if (!r->n_used || b->estimator == NULL) {
        return 0;
    }
    double *input = b->estimator->input;
    memcpy(input, strain_of(s), (size_t)p->n_gauges * sizeof *input);
    input[p->n_gauges] = b->pressure;
    for (int32_t k = 0; k < p->n_flow; k++) {
        if (b->place[k] >= 0) {
            input[b->place[k]] = flow[k];
        }
    }
    double *mask = b->estimator->input + b->mask;
    for (int32_t g = 0; b->mask && g < p->n_gauges; g++) {
        mask[g] = valid_of(s)[g];
    }
    const int64_t cycles = isnan(b->last_step) ? 1 : whole_number((r->time - b->last_step) / p->cycle);
    const double size = p->cycle * (double)(cycles <= 1 ? 1 : cycles < LONGEST_STEP ? cycles : LONGEST_STEP);
    b->last_step = r->time;
    const int failed = sb_step(b->estimator, &size);
    b->is_stepped = !failed;
    return failed;
}

/* --- the answer, and its frames ---------------------------------------------------------------------------------------- */

int sb_conclude(SbBridge *bridge, const double *now) {
    SbBridge *b = bridge;
    int is_estimated = b->is_stepped;
    b->health = b->is_stepped ? (int)b->output[b->n_outputs - 1] : -1;
    for (int k = 0; k < N_REAL_LOADS; k++) {
        is_estimated &= isfinite(b->output[k]) != 0;
    }
    const int stated = b->is_stepped && b->needs_pressure && isnan(b->pressure) ? NO_COEFFICIENTS : b->health;
    return sb_answer(b->plan, b->state, now, stated, is_estimated);
}

static int compose(const SbBridge *b, int kind) {
    for (int32_t f = 0; f < b->n_frames; f++) {
        const SentFrame *frame = &b->frame[f];
        if (frame->kind != kind) {
            continue;
        }
        double picked[MOST_SIGNALS];
        for (int32_t k = 0; k < frame->n_signals; k++) {
            picked[k] = b->value[b->source[frame->first + k]];
        }
        if (sb_encode(b->signal + frame->first, frame->n_signals, picked, b->counter[f], &frame->protection,
                      b->data + MOST_BYTES * f, frame->length) >= 0) {
            return f;
        }
        b->counter[f] = (uint8_t)((b->counter[f] + 1) % frame->modulus);
    }
    return -1;
}

int sb_compose(SbBridge *bridge) {
    SbBridge *b = bridge;
    const SbResult *r = &b->state->result;
    const SbEstimate estimate = {
        .loads = b->is_stepped ? b->output : NULL,
        .chi_square = b->is_stepped ? b->output[CHI_SQUARE] : NAN,
        .score = b->is_stepped && b->score >= 0 ? b->output[b->score] : NAN,
        .pressure = b->pressure,
        .health = b->health,
        .n_gauges = b->n_gauges,
        .configuration = b->configuration,
    };
    const int published = b->is_stepped && has_coefficients(r->quality);
    keep_last(&b->last, r, &estimate);
    result_values(r, &estimate, b->value);
    for (int32_t k = 0; k < b->n_others; k++) {
        b->value[R_OTHERS + k] = published && b->other[k] >= 0 ? sent_value(b->output[b->other[k]], b->step[k]) : NAN;
    }
    const int refused = compose(b, OF_RESULT);
    if (refused >= 0 || !(r->causes >> 16)) {
        return refused;
    }
    detail_values(r, b->value);
    return compose(b, OF_DETAIL);
}

int sb_compose_status(SbBridge *bridge, const double *now) {
    const SbBridge *b = bridge;
    status_values(&b->last, &b->state->account, *now, b->configuration, b->value);
    b->value[S_BUS] = b->bus_state;
    b->value[S_FAILURES] = b->send_failures & 0xFFFF;
    b->value[S_REOPENED] = b->reconnects < 255 ? b->reconnects : 255;
    const int refused = compose(b, OF_STATUS);
    last_details(&b->last, b->value);
    return refused >= 0 ? refused : compose(b, OF_DETAIL);
}
