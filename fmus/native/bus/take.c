/* Frames in: not too many, whole and ours, next in order, of the newest session, and into their cycle.

   A cycle ends when it is complete, with its trailer, by a frame of the next one, or at its deadline. The sample time
   separates cycles where every frame has one; elsewhere the trailer does, or a frame that comes a second time. */

#include <math.h>
#include <string.h>

#include "signals.h"

enum { WINDOW = 10, MAX_DELTA = 3, CATCH_UP = 10, SESSION_PATIENCE = 100, RECENT = 8 };

void settle(SbState *s, int kind, double time) {
    SbAccount *a = &s->account;
    a->count[kind]++;
    if (a->first[kind] != a->first[kind]) {
        a->first[kind] = time;
    }
    a->last[kind] = time;
}

void settle_open(SbState *s, int kind, double time) {
    s->account.pending--;
    settle(s, kind, time);
}

void sb_count(SbState *s, int kind, double time) {
    s->account.received++;
    settle(s, kind, time);
}

/* --- end-to-end protection ------------------------------------------------------------------------------------------ */

static int number_of_bits(int32_t bits) {
    int count = 0;
    for (; bits; bits &= bits - 1) {
        count++;
    }
    return count;
}

/* AUTOSAR's E2E state machine (PRS_E2EProtocol, E2E_SMCheck) over a window of ten checks: OK and OKSOMELOST are good,
   ERROR is bad, all others are neither. The first frame that is not in error begins it. */
void e2e_add(SbSlotState *q, int status) {
    enum { ALL = (1 << WINDOW) - 1 };
    if (q->state == E2E_NO_DATA) {
        q->state = status == E2E_ERROR || status == E2E_NO_NEW_DATA ? E2E_NO_DATA : E2E_INIT;
        return;
    }
    q->ok = (q->ok << 1 | (status <= E2E_SOME_LOST)) & ALL;
    q->errors = (q->errors << 1 | (status == E2E_ERROR)) & ALL;
    const int ok = number_of_bits(q->ok), errors = number_of_bits(q->errors);
    if (q->state == E2E_INIT) {
        q->state = errors > 1 ? E2E_INVALID : ok >= 3 ? E2E_VALID : E2E_INIT;
    } else if (q->state == E2E_VALID) {
        q->state = errors > 2 || ok < 1 ? E2E_INVALID : E2E_VALID;
    } else if (errors <= 1 && ok >= 3) {
        q->state = E2E_VALID;
    }
}

/* A frame of a cycle with a trailer has the trailer's state. */
int e2e_is_trusted(const SbPlan *p, const SbState *s, int slot) {
    const int kind = p->slot[slot].kind, by_trailer = p->trailer >= 0 && kind == SB_STRAIN;
    return slots_of(s)[by_trailer ? p->trailer : slot].state == E2E_VALID;
}

/* FNV-1a (G. Fowler, L. C. Noll, K.-P. Vo) with 64 bits, of eight bytes at once, of the rest byte by byte. */
static uint64_t hash_of(uint64_t hash, const uint8_t *data, int n) {
    int k = 0;
    for (uint64_t eight; k + 8 <= n; k += 8) {
        memcpy(&eight, data + k, sizeof eight);
        hash = (hash ^ eight) * UINT64_C(1099511628211);
    }
    for (; k < n; k++) {
        hash = (hash ^ data[k]) * UINT64_C(1099511628211);
    }
    return hash;
}

/* A second sender: the same counter came with other data, or counters of two sequences alternate three times. A sign that
   comes again within ten alarms makes the next alarm longer: a sender that comes seldom is foreign in between, too. */
static void raise_alarm(const SbPlan *p, SbState *s, double time) {
    const double since = time - s->alarm_heard, longest = 250.0 * p->alarm;
    if (!(since <= 10.0 * s->alarm_length)) {
        s->alarm_length = p->alarm;
    } else if (since > p->alarm) {
        s->alarm_length = 4.0 * s->alarm_length < longest ? 4.0 * s->alarm_length : longest;
    }
    const double until = time + s->alarm_length;
    s->alarm_heard = time;
    s->alarm_until = until > s->alarm_until ? until : s->alarm_until;
}

/* Whether a counter has come so lately that one sender has not counted once round since. */
static int came_lately(const SbSlotState *q, int counter, double time, double round) {
    for (int k = 0; k < RECENT; k++) {
        if (q->recent[k] == counter && time - q->recent_time[k] < round) {
            return 1;
        }
    }
    return 0;
}

static void keep_counter(SbSlotState *q, int counter, double time) {
    q->recent[q->n_recent] = counter;
    q->recent_time[q->n_recent] = time;
    q->n_recent = (q->n_recent + 1) % RECENT;
}

static void note_alternation(const SbPlan *p, SbState *s, SbSlotState *q, double time) {
    q->wrong[0] = q->wrong[1];
    q->wrong[1] = q->wrong[2];
    q->wrong[2] = time;
    if (time - q->wrong[0] <= p->alarm) {
        raise_alarm(p, s, time);
    }
}

/* Status of a frame by its counter, against the frame before it; its CRC is correct. A counter that comes again within
   half the time of all its values is of the same round. */
int e2e_count(const SbPlan *p, SbState *s, int slot, double time, const uint8_t *data, int n, const uint8_t *covered,
              int n_covered) {
    const SbSlot *t = &p->slot[slot];
    SbSlotState *q = &slots_of(s)[slot];
    const int modulus = t->profile == 1 ? 15 : 256, counter = frame_counter(t, data);
    const double round = 0.5 * modulus * t->period;
    const uint64_t content = hash_of(hash_of(UINT64_C(14695981039346656037), data, n), covered, n_covered);
    if (counter >= modulus) {
        return E2E_ERROR;
    }
    const int last = q->counter, before = q->counter_before, delta = (counter - last + modulus) % modulus;
    if (last >= 0 && delta == 0) {
        if (content != q->content && time - q->came < round) {
            raise_alarm(p, s, time);
        }
        q->came = time;
        return E2E_REPEATED;
    }
    const int is_known = came_lately(q, counter, time, round);
    keep_counter(q, counter, time);
    const int conflicts = counter == before && content != q->content_before && time - q->came_before < round;
    q->counter_before = last;
    q->content_before = q->content;
    q->came_before = q->came;
    q->counter = counter;
    q->content = content;
    q->came = time;
    if (last < 0 || delta <= MAX_DELTA) {
        return delta == 1 || last < 0 ? E2E_OK : E2E_SOME_LOST;
    }
    const int since = (counter - before + modulus) % modulus, gap = (last - before + modulus) % modulus;
    const int was_missing = since < gap && gap <= MAX_DELTA && !is_known; /* it is late, of the same sender */
    if (before >= 0 && since >= 1 && since <= MAX_DELTA && !was_missing) {
        note_alternation(p, s, q, time);
    }
    if (conflicts) {
        raise_alarm(p, s, time);
    }
    return E2E_WRONG_SEQUENCE;
}

/* --- the sender ------------------------------------------------------------------------------------------------------ */

/* A frame proves itself once more. */
static void begin_checks(SbSlotState *q) {
    q->ok = q->errors = 0;
    q->state = E2E_NO_DATA;
}

/* Settle the open cycle's frames as unfinished. */
static void drop_open(const SbPlan *p, SbState *s, double time) {
    SbSlotState *q = slots_of(s);
    for (int i = 0; i < p->n_slots; i++) {
        if (q[i].here && p->slot[i].kind != SB_HELD) {
            settle_open(s, SB_UNFINISHED, time);
        }
        q[i].here = 0;
    }
    s->n_open = 0;
    s->deadline = INFINITY;
}

/* Another run of the sender: nothing that was proven of the one before holds for it. */
static void forget_sender(const SbPlan *p, SbState *s) {
    SbSlotState *q = slots_of(s);
    drop_open(p, s, s->first);
    for (int i = 0; i < p->n_slots; i++) {
        if (p->slot[i].kind != SB_OF_FLOW || p->slot[i].shares_clock) {
            q[i].counter = q[i].counter_before = -1;
            begin_checks(&q[i]);
        }
        q[i].held_since = q[i].heard = -INFINITY;
    }
    SbQuantity *v = quantities_of(s);
    for (int k = 0; k < p->n_flow; k++) {
        if (v[k].shares_clock) {
            v[k].value = v[k].stated = NAN;
            v[k].was_known = 0;
        }
    }
    s->clock.is_set = s->clock.has_lower = 0;
    s->has_seen = s->has_newest = s->has_proven = s->n_late = s->n_intervals = 0;
    s->young_oldest = -INFINITY;
}

/* Whether a session is the newest one; a newer one is a restart. An older one is refused; where restarts need no proof, while
   the newest is heard. */
int session_is_new(const SbPlan *p, SbState *s, int session, double time) {
    const int ahead = (session - s->session) & 0xFFFF;
    if (s->has_session && ahead) {
        if (ahead >= 0x8000 && (!p->accepts || time - s->session_heard < SESSION_PATIENCE * p->cycle)) {
            s->hears_old = 1; /* a recording of before, or a sender whose number does not rise */
            s->noted |= SB_RESTART;
            return 0;
        }
        forget_sender(p, s);
        s->noted |= SB_JUMP;
        s->is_unproven = !p->accepts && !p->is_authentic && !p->is_answered;
    }
    s->session = session;
    s->has_session = 1;
    s->hears_old = 0;
    s->session_heard = time;
    return 1;
}

void sb_confirm(const SbPlan *p, SbState *s) {
    SbSlotState *q = slots_of(s);
    s->is_unproven = s->hears_old = s->has_proven = s->n_late = s->has_session = s->has_seen = 0;
    s->clock.is_set = s->clock.has_lower = 0;
    s->young_oldest = -INFINITY;
    s->is_confirmed = 1;
    for (int i = 0; i < p->n_slots; i++) {
        q[i].clock.is_set = 0;
    }
}

void sb_restart(const SbPlan *p, SbState *s, double now) {
    SbSlotState *q = slots_of(s);
    drop_open(p, s, now);
    for (int i = 0; i < p->n_slots; i++) {
        if (p->slot[i].kind != SB_OF_FLOW) {
            begin_checks(&q[i]);
        }
    }
    s->noted |= SB_BUS;
}

void sb_finish(const SbPlan *p, SbState *s, double now) {
    drop_open(p, s, now);
}

void sb_note(SbState *s, uint32_t causes) {
    s->noted |= causes;
}

void sb_note_bridge(SbState *s, double until) {
    s->bridge_until = until;
}

/* --- flow and commands ------------------------------------------------------------------------------------------------ */

static int status_of(const SbPlan *p, const SbSlot *t, const uint8_t *data) {
    const int64_t status = t->status >= 0 ? signal_raw(&p->signal[t->status], data) : 0;
    return status < 0 || status > 255 ? 255 : (int)status; /* of 64 bits the largest come as negative numbers */
}

static int64_t ticks_of(const SbPlan *p, const SbSlot *t, const uint8_t *data) {
    return t->sample_time >= 0 ? signal_raw(&p->signal[t->sample_time], data) : 0;
}

/* Hold the quantities of a frame; air at rest is stated as 0, which is of no use for coefficients. */
static int take_flow(const SbPlan *p, SbState *s, int slot, double time, const uint8_t *data) {
    const SbSlot *t = &p->slot[slot];
    SbSlotState *q = &slots_of(s)[slot];
    const int is_good = status_of(p, t, data) <= 1;
    const int64_t ticks = ticks_of(p, t, data);
    double delay = 0.0;
    if (!e2e_is_trusted(p, s, slot)) {
        return SB_UNTRUSTED;
    }
    if (t->sample_time >= 0 && !t->shares_clock && !clock_delay(p, &q->clock, t, ticks, time, &delay)) {
        return SB_NOT_USABLE;
    }
    int is_used = 0;
    for (int k = t->first; k < t->first + t->n_signals; k++) {
        const SbSignal *g = &p->signal[k];
        SbQuantity *v = &quantities_of(s)[g->target];
        const int64_t raw = signal_raw(g, data);
        const double value = signal_value(g, raw), in_si = value * g->factor + g->added;
        const int is_stated = isfinite(value) && is_good && !signal_is_code(p, g, raw);
        const int is_usable =
            is_stated && g->smallest <= in_si && in_si <= g->largest && !signal_is_outside(g, raw, value);
        v->stated = is_stated ? in_si : NAN;
        v->value = is_usable ? in_si : NAN;
        v->stated_at = v->arrived = time;
        v->delay = delay;
        v->ticks = ticks;
        v->shares_clock = t->shares_clock && t->sample_time >= 0;
        v->was_known |= is_usable;
        is_used |= is_usable;
    }
    return is_used ? SB_USED : SB_NOT_USABLE;
}

/* The number of a command, if it is of the time of the strains: one that was recorded is not. */
static int take_command(const SbPlan *p, SbState *s, int slot, double time, const uint8_t *data) {
    const SbSlot *t = &p->slot[slot];
    if (!e2e_is_trusted(p, s, slot)) {
        return SB_UNTRUSTED;
    }
    if (!s->has_seen || t->sample_time < 0 || status_of(p, t, data) > 1) {
        return SB_NOT_USABLE;
    }
    const double of_strains = (double)s->seen_ticks * p->tick + (time - s->seen_at);
    const int bits = p->signal[t->sample_time].length;
    const int64_t apart = ticks_ahead(ticks_of(p, t, data), (int64_t)(of_strains / t->tick), bits);
    if (fabs((double)apart * t->tick) > p->max_age) {
        return SB_TOO_OLD;
    }
    s->request = (int32_t)signal_raw(&p->signal[t->request], data);
    return SB_USED;
}

/* Hold strains that come more slowly than cycles. */
static int take_held(const SbPlan *p, SbState *s, int slot, double time, const uint8_t *data) {
    const SbSlot *t = &p->slot[slot];
    SbSlotState *q = &slots_of(s)[slot];
    memcpy(data_of(s) + t->data, data, (size_t)t->length);
    q->here = 1;
    q->held_since = time;
    q->ticks = ticks_of(p, t, data);
    q->status = status_of(p, t, data);
    for (int k = t->first; k < t->first + t->n_signals; k++) {
        const SbSignal *g = &p->signal[k];
        const int64_t raw = signal_raw(g, data);
        if (!signal_is_code(p, g, raw) && !signal_is_outside(g, raw, signal_value(g, raw))) {
            return e2e_is_trusted(p, s, slot) ? SB_USED : SB_UNTRUSTED;
        }
    }
    return e2e_is_trusted(p, s, slot) ? SB_NOT_USABLE : SB_UNTRUSTED;
}

/* --- cycles ----------------------------------------------------------------------------------------------------------- */

enum { SAME_CYCLE, NEXT_CYCLE, TWICE, TOO_LATE };

/* What a frame is by its sample time: of the open cycle, of a later one, or of an older one. Older ones in a row are a
   clock that was set back. */
static int place_in_time(const SbPlan *p, SbState *s, const SbSlotState *q, int64_t ticks, int counter) {
    if (!s->has_newest) {
        return NEXT_CYCLE;
    }
    const int64_t ahead = ticks_ahead(ticks, s->newest, p->bits);
    if (ahead > 0) {
        return NEXT_CYCLE;
    }
    if (ahead == 0 && s->n_open && (counter < 0 || counter == s->open_counter)) {
        return q->here ? TWICE : SAME_CYCLE;
    }
    if (++s->n_late_frames <= p->late_limit * p->n_cycle) {
        return TOO_LATE;
    }
    s->noted |= SB_JUMP;
    for (int i = 0; i < p->n_slots; i++) {
        if (p->slot[i].kind != SB_OF_FLOW && p->slot[i].kind != SB_COMMAND) {
            begin_checks(&slots_of(s)[i]);
        }
    }
    return NEXT_CYCLE;
}

/* Put a frame into its cycle; SB_READY if a cycle has ended with it. */
static int offer(const SbPlan *p, SbState *s, int slot, double time, const uint8_t *data) {
    const SbSlot *t = &p->slot[slot];
    SbSlotState *q = &slots_of(s)[slot];
    const int64_t ticks = ticks_of(p, t, data);
    const int counter = t->profile ? frame_counter(t, data) : -1;
    const int place = !p->is_timed ? (q->here ? NEXT_CYCLE : SAME_CYCLE) : place_in_time(p, s, q, ticks, counter);
    int n_results = 0;
    if (place == TWICE || place == TOO_LATE) {
        settle(s, place == TWICE ? SB_REPEATED : SB_LATE, time);
        return SB_TAKEN;
    }
    if (place == NEXT_CYCLE && s->n_open) {
        close_cycle(p, s, time);
        n_results += !s->skips;
    }
    s->n_late_frames = 0;
    if (!s->n_open) {
        s->first = s->arrival = time;
        s->deadline = time + p->deadline;
        s->newest = ticks;
        s->has_newest = p->is_timed;
        s->open_counter = counter;
    }
    memcpy(data_of(s) + t->data, data, (size_t)t->length);
    q->here = 1;
    q->ticks = ticks;
    q->status = status_of(p, t, data);
    s->arrival = time > s->arrival ? time : s->arrival;
    s->n_open++;
    s->account.pending++;
    const int has_state = p->state >= 0 && (slots_of(s)[p->state].here || s->expects_state);
    if ((s->n_open == p->n_cycle + has_state || t->kind == SB_TRAILER) && !n_results) {
        close_cycle(p, s, time);
        n_results += !s->skips;
    }
    return n_results ? SB_READY : SB_TAKEN;
}

/* --- one frame --------------------------------------------------------------------------------------------------------- */

static int is_shed(const SbPlan *p, SbSlotState *q, const SbSlot *t, double time) {
    const double since = time - q->token_time;
    q->tokens += since > 0.0 ? since * t->rate : 0.0;
    q->tokens = q->tokens < p->burst ? q->tokens : p->burst;
    q->token_time = time;
    if (q->tokens < 1.0) {
        return 1;
    }
    q->tokens -= 1.0;
    return 0;
}

/* Class of a frame that its own check refuses, or -1. The check of a trailer is its cycle's. */
static int refused_by_check(const SbPlan *p, SbState *s, int slot, double time, const uint8_t *data, int n) {
    static const int class_of[] = {[E2E_OK] = -1, [E2E_SOME_LOST] = -1, [E2E_REPEATED] = SB_REPEATED,
                                   [E2E_WRONG_SEQUENCE] = SB_WRONG_SEQUENCE, [E2E_ERROR] = SB_CORRUPT};
    const SbSlot *t = &p->slot[slot];
    SbSlotState *q = &slots_of(s)[slot];
    if (t->kind == SB_TRAILER) {
        return -1;
    }
    if (t->profile && frame_crc(t, data, n, NULL, 0) != frame_crc_in(t, data)) {
        e2e_add(q, E2E_ERROR);
        return SB_CORRUPT;
    }
    if (t->configuration >= 0 && signal_raw(&p->signal[t->configuration], data) != t->expected) {
        e2e_add(q, E2E_ERROR);
        return SB_WRONG_CONFIGURATION;
    }
    if (t->kind == SB_SENDER_STATE && t->profile) {
        if (!session_is_new(p, s, (int)signal_raw(&p->signal[t->session], data), time)) {
            return SB_OLD_SESSION;
        }
    }
    const int status = t->profile ? e2e_count(p, s, slot, time, data, n, NULL, 0) : E2E_OK;
    e2e_add(q, status);
    return class_of[status];
}

/* Whether the authenticator of a frame is to be checked: not of one that was altered on the bus, as its CRC shows. */
static int is_to_be_proven(const SbSlot *t, const uint8_t *data, int n, int flags) {
    return t->is_secured && !(flags & SB_FLAG_AUTHENTIC) && frame_crc(t, data, n, NULL, 0) == frame_crc_in(t, data);
}

/* Class of a frame that is not looked into, or -1. */
static int refused_at_once(const SbPlan *p, SbState *s, int slot, double time, int n, int flags) {
    const SbSlot *t = &p->slot[slot];
    if (n != t->length || (flags & SB_FLAG_FD ? 1 : 0) != t->is_fd) {
        return SB_WRONG_FORMAT;
    }
    if (is_shed(p, &slots_of(s)[slot], t, time)) {
        s->noted |= SB_OVERLOAD;
        return SB_SHED;
    }
    return -1;
}

/* The slot of an identifier by the value of its multiplexer, -1 where it belongs to no frame of the plan. */
static int selected_slot(const SbPlan *p, int slot, const uint8_t *data) {
    while (slot >= 0 && p->slot[slot].selector >= 0 &&
           signal_raw(&p->signal[p->slot[slot].selector], data) != p->slot[slot].value) {
        slot = p->slot[slot].next;
    }
    return slot;
}

int sb_take(const SbPlan *p, SbState *s, int slot, const double *now, const uint8_t *data, int n, int flags) {
    const double time = *now;
    const int is_offered_again = flags & (SB_FLAG_AUTHENTIC | SB_FLAG_FORGED | SB_FLAG_STALE);
    int kind = -1;
    if (!is_offered_again) {
        if (sb_due(p, s, now) == SB_READY) {
            return SB_AGAIN;
        }
        s->account.received++;
        kind = refused_at_once(p, s, slot, time, n, flags);
    }
    slot = kind < 0 ? selected_slot(p, slot, data) : slot;
    kind = slot < 0 ? SB_NOT_USABLE : kind;
    if (kind < 0 && is_to_be_proven(&p->slot[slot], data, n, flags)) {
        if (!is_offered_again) {
            return SB_AUTHENTICATE;
        }
        s->noted |= SB_NOT_AUTHENTIC;
        kind = flags & SB_FLAG_FORGED ? SB_FORGED : SB_NOT_FRESH;
    }
    kind = kind < 0 ? refused_by_check(p, s, slot, time, data, n) : kind;
    switch (kind < 0 ? p->slot[slot].kind : -1) {
    case -1: break;
    case SB_OF_FLOW: kind = take_flow(p, s, slot, time, data); break;
    case SB_COMMAND: kind = take_command(p, s, slot, time, data); break;
    case SB_HELD: kind = take_held(p, s, slot, time, data); break;
    default: return offer(p, s, slot, time, data);
    }
    settle(s, kind, time);
    return SB_TAKEN;
}

/* --- time --------------------------------------------------------------------------------------------------------------- */

/* Answer the next cycle in which nothing came. After the bridge stood still, a status for each of them is useless. */
static void be_silent(const SbPlan *p, SbState *s, double now) {
    double time = s->next_status;
    const double behind = (now - time) / p->cycle - CATCH_UP;
    if (behind >= 1.0) {
        time += (double)(int64_t)behind * p->cycle;
    }
    s->next_status = time + p->cycle;
    SbSlotState *q = slots_of(s);
    for (int i = 0; i < p->n_slots; i++) {
        if (p->slot[i].kind == SB_STRAIN || p->slot[i].kind == SB_TRAILER) {
            e2e_add(&q[i], E2E_NO_NEW_DATA);
        }
    }
    const uint32_t causes = s->noted | SB_SILENT | causes_of_others(s, time);
    s->noted = 0;
    SbResult *r = &s->result;
    *r = (SbResult){.time = time, .arrival = NAN, .age = NAN, .uncertainty = NAN, .sample_time = -1, .counter = -1,
                    .is_silent = 1, .causes = causes, .request = s->request};
    for (int i = 0; i < p->n_gauges; i++) {
        strain_of(s)[i] = NAN;
        valid_of(s)[i] = 0;
        reason_of(s)[i] = SB_NO_FRAME;
    }
    for (int k = 0; k < p->n_flow; k++) {
        flow_of(s)[k] = NAN;
    }
}

int sb_due(const SbPlan *p, SbState *s, const double *now) {
    while (s->deadline <= *now && s->deadline <= s->next_status) {
        close_cycle(p, s, s->deadline);
        if (!s->skips) {
            return SB_READY;
        }
    }
    if (s->next_status <= *now) {
        be_silent(p, s, *now);
        return SB_READY;
    }
    return SB_TAKEN;
}
