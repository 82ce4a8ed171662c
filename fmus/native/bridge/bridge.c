/* What a bridge does in every cycle around the machine: a step of the estimator, whose variables have the numbers of
   FMI 2.0, with the strains and the flow of the result that is ready; its answer; and the frames of the result. */

#include <math.h>
#include <string.h>

#include "../bus/rounding.h"
#include "bridge.h"

enum { LONGEST_STEP = 100, CHI_SQUARE = N_REAL_LOADS };

static const double LARGEST_UNCERTAINTY = 6553.4, LARGEST_SCORE = 25.4;

void sb_sizes(int64_t size[14]) {
    const size_t sizes[14] = {
        sizeof(SbSignal),  sizeof(SbSlot),   sizeof(SbPlan),      sizeof(SbResult),   sizeof(SbAccount),
        sizeof(SentFrame), sizeof(SbBridge), sizeof(SbEstimator), sizeof(SbExchange), sizeof(SbLogged),
        sizeof(SbQueue),   offsetof(SbState, result),  offsetof(SbState, account), offsetof(SbState, slots_at),
    };
    for (int k = 0; k < 14; k++) {
        size[k] = (int64_t)sizes[k];
    }
}

/* --- frames in ------------------------------------------------------------------------------------------------------- */

void sb_log(SbQueue *q, const SbLogged *frame, const uint8_t *data) {
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

/* Place of a key, -1 for none. */
static int32_t place_of(const SbBridge *b, uint32_t key) {
    int32_t k = b->n_keys - 1;
    while (k >= 0 && b->key[k] != key) {
        k--;
    }
    return k;
}

int sb_hear(SbBridge *b, const uint8_t *data) {
    const SbLogged *h = b->heard;
    const int32_t k = place_of(b, h->key);
    if (k < 0 || b->slot[k] < 0 || h->flags & (SB_IS_ERROR | SB_IS_REMOTE)) {
        return SB_OTHER;
    }
    const int flags = (h->flags & SB_IS_FD ? SB_FLAG_FD : 0) | h->verdict;
    const int event = sb_take(b->plan, b->state, b->slot[k], &h->time, data, h->n, flags);
    if (b->queue != NULL && (event == SB_TAKEN || event == SB_READY)) {
        sb_log(b->queue, h, data);
    }
    b->has_come[k] = 1;
    return event;
}

int sb_refuse(SbBridge *b, const uint8_t *data) {
    const SbLogged *h = b->heard;
    const int32_t k = place_of(b, h->key), of_other_width = place_of(b, h->key ^ EXTENDED_FLAG);
    const int kind = h->flags & SB_IS_ERROR                              ? SB_ERROR_FRAME
                     : k >= 0 && b->slot[k] < 0                          ? SB_OF_SECOND_BRIDGE
                     : k >= 0                                            ? SB_REMOTE_FRAME
                     : of_other_width >= 0 && b->slot[of_other_width] >= 0 ? SB_WRONG_FORMAT
                                                                         : SB_UNKNOWN;
    if (kind == SB_OF_SECOND_BRIDGE) {
        sb_note_bridge(b->state, h->time + b->alarm);
    }
    sb_count(b->state, kind, h->time);
    if (b->queue != NULL) {
        sb_log(b->queue, h, data);
    }
    return kind;
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
        const int32_t next = number > -2147483648.0 && number < 2147483647.0 ? (int32_t)whole_number(number) : 0;
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

int sb_step(SbEstimator *e, const double *size) {
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

int sb_estimate(SbBridge *b) {
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

int sb_conclude(SbBridge *b, const double *now) {
    int is_estimated = b->is_stepped;
    b->health = b->is_stepped ? (int)b->output[b->n_outputs - 1] : -1;
    for (int k = 0; k < N_REAL_LOADS; k++) {
        is_estimated &= isfinite(b->output[k]) != 0;
    }
    const int stated = b->is_stepped && b->needs_pressure && isnan(b->pressure) ? HEALTH_NO_COEFFICIENTS : b->health;
    return sb_answer(b->plan, b->state, now, stated, is_estimated);
}

int has_details(uint32_t causes) {
    return causes >> 16 != 0;
}

double *details_in(const SbBridge *bridge, double *value) {
    return value + R_OTHERS + bridge->n_others;
}

/* --- values of the frames ------------------------------------------------------------------------------------------------

   What is not published, or not known, is NaN, which frames have a number for; what exceeds its signal is the largest one. */

static double at_most(double value, double largest) {
    return value > largest ? largest : value;
}

/* What is sent of a load, in steps rounded up, 0 for none: a standard deviation is never stated smaller than it is. */
static double sent_value(double estimate, double step) {
    const double steps = estimate / step;
    if (step == 0.0) {
        return estimate;
    }
    if (!(steps >= 0.0 && steps <= 65534.0)) { /* above the range there is none */
        return NAN;
    }
    const double whole = (double)(int32_t)steps;
    return step * (whole < steps ? whole + 1.0 : whole);
}

static void detail_values(const SbResult *r, double *value) {
    value[0] = value[1] = 0.0;
    value[D_QUALITY] = r->quality;
    value[D_CAUSES] = r->causes;
    value[D_USABLE] = r->usable;
    value[D_UNCERTAINTY] = at_most(1e3 * r->uncertainty, LARGEST_UNCERTAINTY);
    value[D_ANSWERED] = r->counter < 0 ? 0.0 : r->counter;
}

/* What the status will say of the result. */
static void keep_last(SbBridge *b, double score) {
    const SbResult *r = &b->state->result;
    SbLast *last = &b->last;
    detail_values(r, last->detail);
    last->score = score;
    last->has_last = 1;
    last->results++;
    if (b->is_stepped && (r->quality == SB_VALID || r->quality == SB_UNPROTECTED)) {
        memcpy(last->loads, b->output, sizeof last->loads);
        last->has_valid = 1;
        last->ready = r->time;
        last->age = r->age;
    }
}

void result_of(SbBridge *b, double *value) {
    const SbResult *r = &b->state->result;
    const double score = b->is_stepped && b->score >= 0 ? b->output[b->score] : NAN;
    const int published = b->is_stepped && has_coefficients(r->quality);
    value[0] = value[1] = 0.0; /* CRC and counter are written last */
    for (int k = 0; k < N_REAL_LOADS; k++) {
        value[R_COEFFICIENTS + k] = published ? b->output[k] : NAN; /* those of R_SIGMA follow */
    }
    value[R_QUALITY] = r->quality;
    value[R_HEALTH] = b->health < 0 ? NAN : b->health;
    value[R_USABLE] = r->usable;
    value[R_SAMPLE_TIME] = r->sample_time < 0 ? NAN : (double)r->sample_time;
    value[R_CHI_SQUARE] = b->is_stepped ? b->output[CHI_SQUARE] : NAN;
    value[R_AGE] = 1e3 * r->age;
    value[R_CAUSES] = (double)((r->causes & 0x7FFFu) | (r->causes >> 16 ? 0x8000u : 0u));
    value[R_GAUGES] = at_most(b->n_gauges, 255.0);
    value[R_ANSWERED] = r->counter < 0 ? 0.0 : r->counter;
    value[R_CONFIGURATION] = b->configuration;
    value[R_PRESSURE] = r->is_silent ? NAN : b->pressure;
    value[R_SCORE] = at_most(score, LARGEST_SCORE);
    for (int32_t k = 0; k < b->n_others; k++) {
        value[R_OTHERS + k] = published && b->other[k] >= 0 ? sent_value(b->output[b->other[k]], b->step[k]) : NAN;
    }
    detail_values(r, details_in(b, value));
    keep_last(b, score);
}

static void status_values(const SbBridge *b, double time, double *value) {
    const SbLast *last = &b->last;
    const SbAccount *account = &b->state->account;
    int64_t rejected = 0;
    for (int k = 0; k < SB_N_CLASSES; k++) {
        rejected += k == SB_USED ? 0 : account->count[k];
    }
    const int64_t count[] = {account->received, account->count[SB_USED], rejected, (int64_t)last->results,
                             account->count[SB_OVERRUN]};
    memset(value, 0, N_STATUS * sizeof *value);
    for (int k = 0; k < N_LOADS_SENT; k++) {
        value[S_LAST + k] = last->has_valid ? last->loads[k] : NAN;
        value[S_COUNTS + k] = (double)((uint64_t)count[k] & 0xFFFFFFFFu);
        value[S_COUNTS_16 + k] = (double)((uint64_t)count[k] & 0xFFFFu);
    }
    const double age = last->has_valid ? 1e3 * (time - last->ready + last->age) : NAN;
    value[S_AGE] = at_most(age, 4294967294.0);
    value[S_AGE_16] = at_most(age, 655340.0);
    value[S_QUALITY] = last->has_last ? last->detail[D_QUALITY] : (double)SB_NO_DATA;
    value[S_BUS] = b->bus_state;
    value[S_FAILURES] = b->send_failures & 0xFFFF;
    value[S_REOPENED] = b->reconnects < 255 ? b->reconnects : 255;
    value[S_DRIFT] = NAN; /* which earlier versions have measured */
    value[S_SCORE] = last->has_last ? last->score : NAN;
    value[S_CONFIGURATION] = b->configuration;
}

/* Of the last result, if there is any. */
static void last_details(const SbLast *last, double *value) {
    memset(value, 0, N_DETAILS * sizeof *value);
    value[D_UNCERTAINTY] = NAN;
    if (last->has_last) {
        memcpy(value, last->detail, sizeof last->detail);
    }
}

/* --- and the frames ---------------------------------------------------------------------------------------------------- */

int compose_frames(const SbBridge *b, int kind, const double *value) {
    for (int32_t f = 0; f < b->n_frames; f++) {
        const SentFrame *frame = &b->frame[f];
        if (frame->kind != kind) {
            continue;
        }
        double picked[MOST_SIGNALS];
        for (int32_t k = 0; k < frame->n_signals; k++) {
            picked[k] = value[b->source[frame->first + k]];
        }
        if (sb_encode(b->signal + frame->first, frame->n_signals, picked, b->counter[f], &frame->protection,
                      b->data + MOST_BYTES * f, frame->length) >= 0) {
            return f;
        }
        b->counter[f] = (uint8_t)((b->counter[f] + 1) % frame->modulus);
    }
    return -1;
}

int sb_compose(SbBridge *b) {
    result_of(b, b->value);
    const int refused = compose_frames(b, OF_RESULT, b->value);
    return refused >= 0 || !has_details(b->state->result.causes) ? refused
                                                                  : compose_frames(b, OF_DETAIL, details_in(b, b->value));
}

int sb_compose_status(SbBridge *b, const double *now) {
    status_values(b, *now, b->value);
    const int refused = compose_frames(b, OF_STATUS, b->value);
    last_details(&b->last, b->value);
    return refused >= 0 ? refused : compose_frames(b, OF_DETAIL, b->value);
}
