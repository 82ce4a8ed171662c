#include <math.h>

#include "rounding.h"
#include "sender_clock.h"

/* A difference of two sample times of `bits` bits, at least -half and less than half of their range. */
static int64_t wrapped(uint64_t difference, int64_t bits) {
    const uint64_t high = difference << (64 - bits);
    return high >> 63 ? (int64_t) ~(~high >> (64 - bits)) : (int64_t)(high >> (64 - bits));
}

static void begin_drift(SbClock *c, double local, double offset) {
    c->n_minima = 0;
    c->window_start = local;
    c->window_min = offset;
}

static SbModel new_model(const SbClock *c, double local, int64_t ticks) {
    const double source = (double)ticks * c->tick, delay = local - source;
    return (SbModel){1, ticks, 1, source, local, delay, delay, local, delay};
}

/* Time of the sender from a model's last reading to `ticks` [ticks]; after half the range our clock tells how often the
   time has wrapped. */
static double ticks_since(const SbClock *c, const SbModel *m, double elapsed, int64_t ticks) {
    const uint64_t difference = (uint64_t)ticks - (uint64_t)m->ticks;
    const double half = 0.5 * c->range / c->tick;
    if (elapsed < (half - 1.0) * c->tick) {
        return (double)wrapped(difference, c->bits);
    }
    double expected = nearest(elapsed / c->tick);
    if (!(expected >= half && expected < 0x1p62)) {
        expected = 0.0;
    }
    const uint64_t whole = (uint64_t)(int64_t)expected;
    return (double)((int64_t)whole + wrapped(difference - whole, c->bits));
}

/* Update a model with a reading: 1 and its delay [s]; 0, with no update, if they do not fit. `tolerated` is the fraction
   of the jump tolerance by which the delay may shrink. */
static int follow(const SbClock *c, SbModel *m, double local, int64_t ticks, double tolerated, double *offset) {
    const double since_last = local - m->local, elapsed = since_last > 0.0 ? since_last : 0.0;
    const double source = m->source + ticks_since(c, m, elapsed, ticks) * c->tick;
    const double delay = local - source, drift = c->tolerance * elapsed;
    if (source < m->source || delay < m->floor - drift - tolerated * c->jump_tolerance) {
        return 0;
    }
    /* The smallest delay is raised by as much as the clock may drift, and by no more than may be hidden in all. */
    double raised = m->floor + drift, floor = m->floor;
    const double highest = m->lowest + c->hidden;
    raised = highest < raised ? highest : raised;
    floor = raised > floor ? raised : floor;
    floor = delay < floor ? delay : floor;
    m->ticks = ticks;
    m->source = source;
    m->local = local;
    m->floor = floor;
    m->lowest = floor < m->lowest ? floor : m->lowest;
    const double fastest = delay + c->tolerance * (local - m->start);
    m->fastest = fastest < m->fastest ? fastest : m->fastest;
    m->readings++;
    *offset = delay;
    return 1;
}

static int64_t reading_of(SbClock *c, const SbModel *m, double offset) {
    c->age = offset - m->floor;
    c->uncertainty = m->floor - m->fastest + c->tolerance * (m->local - m->start);
    return m->floor - m->lowest >= c->hidden - c->round_off ? SB_HIDES_DELAY : 0;
}

/* Keep the smallest delay of every window, to which the drift is fitted. */
static void keep_minimum(SbClock *c, double local, double offset) {
    c->window_min = offset < c->window_min ? offset : c->window_min;
    if (local - c->window_start >= c->window) {
        double *kept = c->minimum + 2 * (c->n_minima % SB_MINIMA);
        kept[0] = c->window_start;
        kept[1] = c->window_min;
        c->n_minima++;
        c->window_start = local;
        c->window_min = offset;
    }
}

/* Follow the clock of a sender that has been restarted, and keep that of before. */
static void replace(SbClock *c, const SbModel *old, SbModel made, double local) {
    /* A queue on the way outlives a restart of the sender: what may hide in it still may. */
    made.lowest -= old->floor - old->lowest;
    made.fastest -= old->floor - old->fastest + c->tolerance * (local - old->start);
    c->known = made;
    c->before = *old;
    c->jumped.is_set = 0;
    begin_drift(c, local, c->known.floor);
}

/* Take in a sample time that does not fit. Cycles that were held back come one behind the other, each a cycle less late
   than the one before. */
static int64_t take_jump(SbClock *c, double local, int64_t ticks) {
    double offset;
    if (!c->jumped.is_set || !follow(c, &c->jumped, local, ticks, c->steady, &offset)) {
        c->jumped = new_model(c, local, ticks);
    }
    if (c->jumped.readings < c->confirmations) {
        return SB_JUMPED;
    }
    const SbModel old = c->before.is_set ? c->before : c->known;
    replace(c, &old, c->jumped, local);
    return SB_JUMPED | SB_RESTARTED;
}

void clock_begin(SbClock *c, const SbModel *old, double local, int64_t ticks) {
    c->age = c->uncertainty = 0.0;
    replace(c, old, new_model(c, local * c->pace, ticks), local * c->pace);
}

static int64_t read_synchronised(SbClock *c, double local, int64_t ticks) {
    const double half = 0.5 * c->range;
    const double age = -(remainder_of((double)ticks * c->tick - (local + c->shift) + half, c->range) - half);
    if (age < -c->accuracy) {
        return SB_JUMPED;
    }
    c->age = age > 0.0 ? age : 0.0;
    c->uncertainty = c->accuracy;
    return 0;
}

int64_t clock_read(SbClock *c, double local, int64_t ticks) {
    const double now = local * c->pace;
    double offset;
    c->age = c->uncertainty = 0.0;
    if (c->is_synchronised) {
        return read_synchronised(c, local, ticks);
    }
    if (!c->known.is_set) {
        c->known = new_model(c, now, ticks);
        begin_drift(c, now, c->known.floor);
        return 0;
    }
    if (follow(c, &c->known, now, ticks, 1.0, &offset)) {
        c->jumped.is_set = 0;
        keep_minimum(c, now, offset);
        return reading_of(c, &c->known, offset);
    }
    if (c->before.is_set && follow(c, &c->before, now, ticks, 1.0, &offset)) {
        c->known = c->before;
        c->before.is_set = c->jumped.is_set = 0;
        begin_drift(c, now, c->known.floor);
        return reading_of(c, &c->known, offset) | SB_RESUMED;
    }
    return take_jump(c, now, ticks);
}

double clock_seconds_ahead(const SbClock *c, double local, int64_t ticks) {
    if (c->is_synchronised) {
        const double half = 0.5 * c->range;
        return remainder_of((double)ticks * c->tick - (local + c->shift) + half, c->range) - half;
    }
    const SbModel *m = c->before.is_set ? &c->before : &c->known;
    if (!m->is_set) {
        return 0.0;
    }
    const uint64_t since = (uint64_t)whole_number((local * c->pace - m->local) / c->tick);
    return (double)wrapped((uint64_t)ticks - (uint64_t)m->ticks - since, c->bits) * c->tick;
}

int64_t sb_clock_read(SbClock *clock, const double *local, const int64_t *ticks) {
    return clock_read(clock, *local, *ticks);
}

void sb_clock_reset(SbClock *clock) {
    clock->known.is_set = clock->jumped.is_set = clock->before.is_set = 0;
    begin_drift(clock, INFINITY, INFINITY);
}
