/* The end of a cycle: whether it is whole, how old it is, which gauges and what of the flow may be used. */

#include <math.h>
#include <string.h>

#include "rounding.h"
#include "signals.h"

enum { WORST_STATUS = 1, INTERVALS = 16, LOOKED_AT = 4 };

static const double ROUND_OFF = 1e-6; /* by which an age may be above a time-out [s] */

/* --- frames ------------------------------------------------------------------------------------------------------------ */

/* 0 if all frames of strains are there; those that are missing are noted by their E2E state machine. */
static uint32_t miss_frames(const SbPlan *p, SbState *s) {
    uint32_t causes = 0;
    for (int i = 0; i < p->n_slots; i++) {
        SbSlotState *q = &slots_of(s)[i];
        if (p->slot[i].kind == SB_STRAIN && !q->here) {
            causes = SB_PARTIAL;
            e2e_add(q, E2E_NO_NEW_DATA);
        }
    }
    return causes;
}

/* Why a cycle is not used: a reason of its gauges, 0 if it is; SB_FRAME_NOT_TRUSTED: its numbers are correct.

   The trailer's CRC covers the frames of strains one after the other, and the sender's state ahead of them where it was
   sent. A frame on its identifier that the CRC does not cover is another node's. */
static int check_trailer(const SbPlan *p, SbState *s, uint32_t missing) {
    static const int reason_of[] = {[E2E_OK] = 0, [E2E_SOME_LOST] = 0, [E2E_REPEATED] = SB_CYCLE_REPEATED,
                                    [E2E_WRONG_SEQUENCE] = SB_CYCLE_SEQUENCE, [E2E_ERROR] = SB_CYCLE_UNVERIFIED};
    const SbSlot *t = &p->slot[p->trailer];
    SbSlotState *q = &slots_of(s)[p->trailer];
    SbSlotState *state = p->state >= 0 ? &slots_of(s)[p->state] : NULL;
    if (!q->here || missing) {
        e2e_add(q, E2E_NO_NEW_DATA);
        return SB_CYCLE_UNVERIFIED;
    }
    const uint8_t *data = data_of(s) + t->data, *strains = data_of(s) + p->covered;
    int of_state = state != NULL && state->here ? p->slot[p->state].length : 0;
    const uint16_t stated = frame_crc_in(t, data);
    int is_right = frame_crc(t, data, t->length, strains - of_state, p->n_covered + of_state) == stated;
    if (of_state && !is_right) {
        of_state = state->here = 0;
        s->n_open--;
        settle_open(s, SB_UNVERIFIED, s->first);
        is_right = frame_crc(t, data, t->length, strains, p->n_covered) == stated;
    }
    if (!is_right) {
        e2e_add(q, E2E_ERROR);
        return SB_CYCLE_UNVERIFIED;
    }
    if (state != NULL && state->here) {
        const int session = (int)signal_raw(&p->signal[p->slot[p->state].session], data_of(s) + p->slot[p->state].data);
        if (!session_is_new(p, s, session, s->first)) {
            return SB_CYCLE_OLD;
        }
    }
    const int status = e2e_count(p, s, p->trailer, s->arrival, data, t->length, strains - of_state, p->n_covered + of_state);
    e2e_add(q, status);
    return reason_of[status] ? reason_of[status] : q->state == E2E_VALID ? 0 : SB_FRAME_NOT_TRUSTED;
}

/* By how much held strains are older than the cycle [s]; NaN if they are of another time. */
static double held_age(const SbPlan *p, const SbState *s, int slot, int64_t ticks, int is_dated) {
    const SbSlot *t = &p->slot[slot];
    const SbSlotState *q = &slots_of(s)[slot];
    const double received = s->first > q->held_since ? s->first - q->held_since : 0.0;
    if (t->sample_time < 0 || !is_dated) {
        return received;
    }
    const double sampled = t->tick * (double)ticks_ahead(ticks, q->ticks, p->signal[t->sample_time].length);
    /* It may come ahead of the cycle of its own time, whose frames are still on their way. */
    return sampled < -1.5 * p->cycle ? NAN : sampled > received ? sampled : received;
}

/* Which frames are read, and which of them are new; the worst status of their sender. */
static int read_frames(const SbPlan *p, SbState *s, int is_readable, int64_t ticks, int is_dated) {
    int worst = 0;
    s->result.held = 0.0;
    for (int i = 0; i < p->n_slots; i++) {
        const SbSlot *t = &p->slot[i];
        SbSlotState *q = &slots_of(s)[i];
        if (t->kind == SB_HELD) {
            const double age = held_age(p, s, i, ticks, is_dated);
            q->present = age <= t->hold + ROUND_OFF;
            q->fresh = q->present && q->here;
            s->result.held = q->present && age > s->result.held ? age : s->result.held;
        } else if (t->kind == SB_STRAIN) {
            q->present = q->fresh = is_readable && q->here;
        }
        if ((q->present && t->kind <= SB_HELD) || (is_readable && q->here && t->kind == SB_TRAILER)) {
            worst = q->status > worst ? q->status : worst;
        }
    }
    return worst;
}

/* --- time ----------------------------------------------------------------------------------------------------------------- */

/* Whether strains without sample time may have been held back. A gateway releases what it kept faster than a sender sends:
   after a pause none is trusted before a few have come at the pace of a sender. */
static int may_be_held_back(const SbPlan *p, SbState *s) {
    if (s->last_first > -INFINITY && s->first - s->last_first > p->max_age) {
        s->n_held_back = LOOKED_AT;
    } else if (s->n_held_back && s->first - s->last_first > p->cycle / 3.0) {
        s->n_held_back--;
    }
    return s->n_held_back > 0;
}

/* The period of the sender: the mean of INTERVALS but for the longest, which may be a pause. Two measurements in a row beyond
   the tolerance are needed: limits counted in cycles are wrong then. */
static void measure_period(const SbPlan *p, SbState *s, double since, int steps) {
    if (!(since > 0.0) || steps <= 0) {
        s->n_intervals = 0;
        return;
    }
    if (s->n_intervals == 0) {
        s->interval_sum = s->interval_longest = 0.0;
        s->n_steps = 0;
    }
    s->interval_sum += since;
    s->n_steps += steps;
    s->interval_longest = since / steps > s->interval_longest ? since / steps : s->interval_longest;
    if (++s->n_intervals < INTERVALS) {
        return;
    }
    const double period = (s->interval_sum - s->interval_longest) / (s->n_steps - 1);
    s->n_wrong = fabs(period / p->cycle - 1.0) > p->period_tolerance ? s->n_wrong + 1 : 0;
    s->period_is_wrong = s->n_wrong >= 2;
    s->measured_period = period;
    s->n_intervals = 0;
}

/* The oldest result that a sender of this profile can take for the one that answers the cycle of `ticks`; NULL for none. It
   knows results that state no sample time by two counters, and looks for the cycle among its own: one of flipped bits, of
   another run or of a recording may state the same counters within a round of them. */
static const SbAnswer *oldest_alike(const SbPlan *p, const SbState *s, int64_t ticks, int counter) {
    const SbAnswer *named = NULL;
    for (int k = 0; k < SB_ANSWERS && named == NULL; k++) {
        named = s->answer[k].ticks == ticks && s->answer[k].counter == counter ? &s->answer[k] : NULL;
    }
    for (int k = 0; k < SB_ANSWERS && named != NULL; k++) { /* the oldest first */
        const SbAnswer *a = &s->answer[(s->n_answers + k) % SB_ANSWERS];
        if (a == named || (a->counter == counter && a->cycle == named->cycle && a->ticks >= 0 &&
                           named->ready - a->ready < (p->modulus - 0.5) * p->cycle)) {
            return a;
        }
    }
    return NULL;
}

/* What the sender has heard by its state; nothing if the result that it names was not sent by this bridge. */
static Echo echo_of(const SbPlan *p, const SbState *s) {
    Echo echo = {0, 0, 0.0, 0.0, 0.0, 0};
    if (p->state < 0 || !slots_of(s)[p->state].here) {
        return echo;
    }
    const SbSlot *t = &p->slot[p->state];
    const uint8_t *data = data_of(s) + t->data;
    const SbSignal *heard = &p->signal[t->heard_time], *delay = &p->signal[t->heard_delay];
    const int64_t ticks = signal_raw(heard, data), late = signal_raw(delay, data);
    const int counter = (int)signal_raw(&p->signal[t->heard_counter], data);
    if (signal_is_code(p, heard, ticks)) {
        return echo;
    }
    echo.is_named = 1;
    const SbAnswer *a = oldest_alike(p, s, ticks, counter);
    if (a != NULL) {
        const double known = signal_is_code(p, delay, late) ? 0.0 : signal_value(delay, late) * delay->factor;
        echo = (Echo){1, 1, a->ready, known, a->unseen, ticks};
    }
    return echo;
}

/* Age and uncertainty of the strains [s], and causes. */
static uint32_t find_age(const SbPlan *p, SbState *s, int64_t ticks, int counter, double now) {
    SbResult *r = &s->result;
    if (ticks < 0) {
        r->age = now - s->first;
        r->uncertainty = NAN;
        s->goes_on = s->last_first > -INFINITY;
        if (p->bits > 1) { /* a dated cycle that is not verified, whose time says nothing */
            return 0;
        }
        const int is_old = may_be_held_back(p, s);
        if (!is_old) {
            measure_period(p, s, s->first - s->last_first, s->goes_on);
        }
        return is_old || r->age > p->max_age ? SB_OLD : 0;
    }
    const Echo echo = echo_of(p, s);
    const uint32_t causes = clock_date(p, s, ticks, counter, p->tick, &echo, now);
    measure_period(p, s, s->step_time, s->step_count);
    return causes;
}

/* For how long no reading came of a frame that has come now, beyond a cycle [s]; all these have come now. Of the first of a run
   it is infinite: a sender may begin with strains of before, until they change. `is_broken`: behind a jump of the clock they are
   the first of a cycle that is young: those of before may have been a recording's. */
static double time_lost(const SbPlan *p, SbState *s, int64_t ticks, int is_young, int *is_broken) {
    double longest = 0.0;
    for (int i = 0; i < p->n_slots; i++) {
        SbSlotState *q = &slots_of(s)[i];
        q->heard_ticks = s->goes_on ? q->heard_ticks : -1;
        if (p->slot[i].kind != SB_STRAIN || !q->fresh) {
            continue;
        }
        const int goes_on = ticks >= 0 && q->heard_ticks >= 0;
        const double passed = s->first - q->heard;
        const double since = goes_on ? seconds_ahead(ticks, q->heard_ticks, p->bits, p->tick, passed) : passed;
        const double lost = since - p->cycle;
        longest = lost > longest ? lost : longest;
        *is_broken |= ticks >= 0 && !goes_on;
        q->heard = s->first;
        q->heard_ticks = goes_on || is_young ? ticks : -1;
    }
    return longest;
}

/* Strains that all gauges repeat, more often than noise allows, are as old as their first occurrence. Strains behind lost
   cycles may be as old as these, behind a recording as the last young ones: the next ones show it, or repeat them. */
static uint32_t add_repeats(const SbPlan *p, SbState *s, double repeated, double doubted, int64_t ticks, uint32_t of_age) {
    SbResult *r = &s->result;
    uint32_t causes = 0;
    const int is_young = !(of_age & (SB_OLD | SB_AGE_UNKNOWN)) && !s->is_unproven;
    int is_broken = 0;
    const double lost = time_lost(p, s, ticks, is_young, &is_broken);
    const int has_changed = s->changed_at == s->first;
    s->unheard = has_changed || lost > s->unheard ? lost : s->unheard;
    if (p->stuck == 0) {
        return 0;
    }
    r->age += repeated;
    const double hidden = doubted + (s->unheard > 0.4 * p->cycle ? s->unheard : 0.0);
    if (hidden > 0.0) {
        r->uncertainty = (r->uncertainty == r->uncertainty ? r->uncertainty : 0.0) + hidden;
    }
    is_broken = is_broken && s->young_oldest > -INFINITY && !s->is_unproven;
    s->changed_oldest = has_changed ? r->time - r->age - r->uncertainty : s->changed_oldest; /* NaN: not known */
    if (is_broken && !(s->changed_oldest < s->young_oldest)) {
        s->changed_oldest = s->young_oldest;
    }
    const double oldest = r->time - s->changed_oldest;
    if ((is_broken || repeated + doubted > 0.0) && oldest > r->age + r->uncertainty) {
        r->uncertainty = oldest - r->age;
    }
    s->young_oldest = is_young ? r->time - r->age - r->uncertainty : s->young_oldest;
    if (repeated > 0.0 && r->age > p->max_age) {
        causes |= SB_OLD | SB_FROZEN;
    } else if (r->age + r->uncertainty > p->max_age) {
        causes |= SB_AGE_UNKNOWN;
    }
    r->uncertainty = r->uncertainty < INFINITY ? r->uncertainty : NAN;
    return causes;
}

/* --- gauges and flow ------------------------------------------------------------------------------------------------------ */

/* Which gauges are used: their frame is trusted, their values passed; `why` is a reason against all. */
static uint32_t find_valid(const SbPlan *p, SbState *s, int why) {
    uint32_t causes = 0;
    int n_used = 0;
    for (Reading r = {0}; next_reading(p, s, &r);) {
        const int g = r.signal->target, trusted = e2e_is_trusted(p, s, r.slot);
        uint8_t *reason = &reason_of(s)[g];
        if (!r.state->present) {
            *reason = why ? (uint8_t)why : SB_NO_FRAME;
            causes |= r.frame->kind == SB_HELD ? SB_PARTIAL : 0;
        } else {
            causes |= *reason != SB_IS_USED ? SB_GAUGE : 0;
            causes |= trusted ? 0 : SB_NOT_TRUSTED;
            *reason = why ? (uint8_t)why : trusted ? *reason : SB_FRAME_NOT_TRUSTED;
        }
        valid_of(s)[g] = *reason == SB_IS_USED;
        strain_of(s)[g] = valid_of(s)[g] ? r.gauge->last : NAN;
        n_used += valid_of(s)[g];
    }
    s->result.n_used = n_used;
    return causes;
}

/* q_inf that the bus states [Pa], 0 of air at rest, which is of no use for coefficients. */
double stated_pressure(const SbPlan *p, const SbState *s, double now) {
    if (p->fixed_pressure == p->fixed_pressure || p->pressure < 0) {
        return p->fixed_pressure;
    }
    const SbQuantity *q = &quantities_of(s)[p->pressure];
    return now - q->stated_at <= p->pressure_max_age ? q->stated : NAN;
}

/* What is known of the flow. A quantity that shares the clock of the strains is as much older than they are as its sample
   time is; by its reception it must be young, too. */
static uint32_t find_flow(const SbPlan *p, SbState *s, int64_t ticks, double now) {
    uint32_t causes = 0;
    for (int i = 0; i < p->n_slots; i++) {
        const SbSlot *t = &p->slot[i];
        for (int k = t->first; t->kind == SB_OF_FLOW && k < t->first + t->n_signals; k++) {
            const SbSignal *g = &p->signal[k];
            const SbQuantity *v = &quantities_of(s)[g->target];
            double age = now - v->arrived + v->delay;
            if (v->shares_clock && ticks >= 0) {
                const int64_t at_strains = (int64_t)((double)ticks * p->tick / t->tick + 0.5);
                const double before = t->tick * (double)ticks_ahead(at_strains, v->ticks, p->signal[t->sample_time].length);
                const double by_clock = s->result.age + before;
                age = before < -1.5 * p->cycle ? INFINITY : by_clock > age ? by_clock : age;
            }
            const int is_known = age <= g->max_age && v->value == v->value;
            flow_of(s)[g->target] = is_known ? v->value : NAN;
            causes |= !is_known && v->was_known ? g->lost : 0;
            causes |= !is_known && g->target == p->pressure && p->fixed_pressure != p->fixed_pressure ? SB_PRESSURE : 0;
        }
    }
    return causes;
}

/* Put the frames of the cycle into their classes. */
static void settle_frames(const SbPlan *p, SbState *s, int why) {
    static const int class_of[] = {[SB_CYCLE_UNVERIFIED] = SB_UNVERIFIED, [SB_CYCLE_REPEATED] = SB_REPEATED,
                                   [SB_CYCLE_SEQUENCE] = SB_WRONG_SEQUENCE, [SB_CYCLE_OLD] = SB_TOO_OLD,
                                   [SB_FRAME_NOT_TRUSTED] = SB_UNTRUSTED};
    for (int i = 0; i < p->n_slots; i++) {
        const SbSlot *t = &p->slot[i];
        SbSlotState *q = &slots_of(s)[i];
        if (q->here && t->kind != SB_HELD) {
            int is_used = t->kind != SB_STRAIN && s->result.n_used > 0;
            for (int k = t->first; t->kind == SB_STRAIN && k < t->first + t->n_signals; k++) {
                is_used |= valid_of(s)[p->signal[k].target];
            }
            const int kind = s->skips ? SB_SKIPPED : why ? class_of[why] : !e2e_is_trusted(p, s, i) ? SB_UNTRUSTED
                             : is_used ? SB_USED : SB_NOT_USABLE;
            settle_open(s, kind, s->arrival);
        }
        q->here = 0;
    }
}

/* --- all ------------------------------------------------------------------------------------------------------------------- */

/* The frame that names the cycle: its trailer, else the first of its strains; -1 for none. Its counter and its sample time
   are the cycle's. */
static int name_cycle(const SbPlan *p, SbState *s) {
    const SbSlotState *q = slots_of(s);
    int named = p->trailer >= 0 && q[p->trailer].here ? p->trailer : -1;
    for (int i = 0; named < 0 && i < p->n_slots; i++) {
        named = q[i].here && p->slot[i].kind == SB_STRAIN ? i : named;
    }
    if (named >= 0) {
        const SbSlot *t = &p->slot[named];
        s->result.counter = t->profile ? frame_counter(t, data_of(s) + t->data) : -1;
        s->result.sample_time = t->sample_time >= 0 ? q[named].ticks : -1;
    }
    return named;
}

/* The first state that is heard: from now on results that it names prove the sender. */
static void expect_state(SbState *s) {
    s->expects_state = 1;
    s->clock.is_set = s->clock.has_lower = s->has_proven = s->is_unproven = 0;
}

/* Causes that others than this sender make. */
uint32_t causes_of_others(const SbState *s, double now) {
    return (now <= s->alarm_until ? SB_SECOND_SENDER : 0) | (now <= s->bridge_until ? SB_SECOND_BRIDGE : 0);
}

/* The strains of a cycle: how old they are, and which may be used. `why`: a reason against all, 0 for none; if there is none,
   age may be one. */
static uint32_t judge_strains(const SbPlan *p, SbState *s, int named, int64_t ticks, int is_readable, int *why, double now) {
    SbResult *r = &s->result;
    double repeated = 0.0, doubted = 0.0;
    const int status = read_frames(p, s, is_readable, r->sample_time, ticks >= 0);
    const uint32_t of_gauges = gauges_check(p, s, status > WORST_STATUS, ticks, &repeated, &doubted);
    uint32_t of_time = 0;
    if (named >= 0) {
        of_time = find_age(p, s, ticks, r->counter, now);
        of_time |= is_readable ? add_repeats(p, s, repeated, doubted, ticks, of_time) : 0;
    } else { /* the state of the sender alone */
        r->age = r->uncertainty = NAN;
    }
    const int is_old = of_time & SB_OLD || (of_gauges & SB_FROZEN && s->all_frozen);
    *why = !*why && is_old ? SB_CYCLE_OLD : *why;
    return of_time | (of_gauges & SB_FROZEN) | (status ? SB_STATUS : 0);
}

void close_cycle(const SbPlan *p, SbState *s, double now) {
    SbResult *r = &s->result;
    uint32_t causes = s->noted | miss_frames(p, s);
    s->noted = 0;
    *r = (SbResult){.time = now, .arrival = s->arrival, .sample_time = -1, .counter = -1, .request = s->request};
    int why = 0;
    if (p->trailer >= 0) {
        why = check_trailer(p, s, causes & SB_PARTIAL);
        causes |= why == SB_FRAME_NOT_TRUSTED ? SB_NOT_TRUSTED : why ? SB_CYCLE_CRC : 0;
        causes |= s->noted; /* a restart that the trailer has shown */
        s->noted = 0;
    }
    s->n_open = 0;
    s->deadline = INFINITY;
    const int is_readable = !why || why == SB_FRAME_NOT_TRUSTED, named = name_cycle(p, s);
    if (!s->expects_state && p->state >= 0 && slots_of(s)[p->state].here && is_readable) {
        expect_state(s);
    }
    const int64_t ticks = is_readable ? r->sample_time : -1;
    causes |= judge_strains(p, s, named, ticks, is_readable, &why, now);
    causes |= find_valid(p, s, why);
    causes |= find_flow(p, s, ticks, now);
    r->age += r->held;
    r->stated_pressure = stated_pressure(p, s, now);
    causes |= s->is_unproven || s->hears_old || s->n_late > p->recovery ? SB_RESTART : 0;
    causes |= s->period_is_wrong ? SB_PERIOD : 0;
    r->causes = causes | causes_of_others(s, now);
    settle_frames(p, s, why);
    s->last_first = s->first;
    s->last_cycle = now;
    s->next_status = now + p->timeout;
    s->noted |= s->skips ? SB_OVERLOAD : 0;
}

/* --- the state ---------------------------------------------------------------------------------------------------------------- */

/* Places of the parts behind the head, each at a multiple of 8 bytes; the size of all. */
static int64_t lay_out(const SbPlan *p, SbState *s) {
    const int64_t size[] = {
        p->n_slots * (int64_t)sizeof(SbSlotState), p->n_gauges * (int64_t)sizeof(SbGauge),
        p->n_flow * (int64_t)sizeof(SbQuantity),   p->n_flow * (int64_t)sizeof(double),
        p->n_gauges * (int64_t)sizeof(double),     p->n_gauges, p->n_gauges, p->n_data + 16,
    };
    int32_t *place = s == NULL ? NULL : &s->slots_at;
    int64_t end = (int64_t)sizeof(SbState);
    for (int k = 0; k < 8; k++) {
        if (place != NULL) {
            place[k] = (int32_t)end;
        }
        end += (size[k] + 7) / 8 * 8;
    }
    return end;
}

int64_t sb_size(const SbPlan *p) {
    return lay_out(p, NULL);
}

void sb_begin(const SbPlan *p, SbState *s, double start) {
    memset(s, 0, (size_t)lay_out(p, NULL));
    lay_out(p, s);
    s->deadline = INFINITY;
    s->next_status = start + p->timeout;
    s->measured_period = NAN;
    s->usual_off = 0.05 * p->cycle;
    s->last_cycle = s->refilled = start;
    s->last_first = s->young_oldest = s->alarm_heard = s->alarm_until = s->bridge_until = -INFINITY;
    s->refusals = 20.0;
    s->request = -1;
    for (int k = 0; k < SB_N_CLASSES; k++) {
        s->account.first[k] = s->account.last[k] = NAN;
    }
    for (int k = 0; k < SB_ANSWERS; k++) {
        s->answer[k].ticks = -1;
    }
    for (int i = 0; i < p->n_slots; i++) {
        SbSlotState *q = &slots_of(s)[i];
        q->tokens = p->burst;
        q->token_time = start;
        q->counter = q->counter_before = -1;
        for (int k = 0; k < 8; k++) {
            q->recent[k] = -1;
        }
        q->came = q->came_before = q->held_since = q->heard = q->wrong[0] = q->wrong[1] = q->wrong[2] = -INFINITY;
    }
    for (int k = 0; k < p->n_flow; k++) {
        quantities_of(s)[k].value = quantities_of(s)[k].stated = NAN;
    }
    gauges_begin(p, s);
}
