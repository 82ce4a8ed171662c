#include <math.h>

#include "counted_time.h"
#include "rounding.h"
#include "sender_clock.h"

/* Largest time between two readings that confirm a jump, in jump tolerances: what comes later may be of another sender. */
static const double CONFIRMED_WITHIN = 25.0;

/* A difference of two sample times of `bits` bits, at least -half and less than half of their range. */
static int64_t wrapped(uint64_t difference, int64_t bits) {
    const uint64_t high = difference << (64 - bits);
    return high >> 63 ? (int64_t) ~(~high >> (64 - bits)) : (int64_t)(high >> (64 - bits));
}

static void begin_minima(SbMinima *m, double local, double offset) {
    m->n = 0;
    m->start = m->at = local;
    m->least = offset;
}

static void begin_drift(SbClock *c, double local, double offset) {
    begin_minima(&c->drift, local, offset);
    begin_minima(&c->rate, local, offset);
    c->is_learned = 0;
    c->count.is_set = 0;
    c->count.doubt = 0.0;
}

/* Largest difference of the sender's rate from the pace: as stated, or as much as a measured rate changes. */
static double tolerance_of(const SbClock *c) {
    return c->is_learned ? c->wander : c->tolerance + fabs(c->pace - c->stated);
}

static SbModel new_model(const SbClock *c, double local, int64_t ticks, int64_t counter) {
    const double source = (double)ticks * c->tick, delay = local - source;
    return (SbModel){.is_set = 1, .ticks = ticks, .readings = 1, .source = source, .local = local, .floor = delay,
                     .lowest = delay, .start = local, .fastest = delay, .begin = source, .counter = counter};
}

/* A difference of two counters, as steps ahead. */
static int64_t forward(int64_t difference, int64_t modulus) {
    return (difference % modulus + modulus) % modulus;
}

/* Time of the sender from a model's last reading to `ticks` [ticks]; after half the range our clock shows how often the
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
    const double delay = local - source, tolerance = tolerance_of(c), drift = tolerance * elapsed;
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
    const double fastest = delay + tolerance * (local - m->start);
    m->fastest = fastest < m->fastest ? fastest : m->fastest;
    m->readings++;
    *offset = delay;
    return 1;
}

/* Age and uncertainty of a reading of the known clock, whose floor was `floor` before. */
static int64_t reading_of(SbClock *c, double floor, int64_t counter) {
    const SbModel *m = &c->known;
    const double raised = m->floor - floor;
    c->age = m->local - m->source - m->floor;
    count_take(&c->count, c->tick, m, c->age, raised > 0.0 ? raised : 0.0, counter);
    c->uncertainty = m->floor - m->fastest + tolerance_of(c) * (m->local - m->start) + m->doubt +
                     m->either + c->count.doubt;
    return m->floor - m->lowest >= c->hidden - c->round_off ? SB_HIDES_DELAY : 0;
}

/* Keep the smallest delay of every window; 1 if one has ended. */
static int keep_minimum(SbMinima *m, double local, double offset) {
    if (offset < m->least) {
        m->least = offset;
        m->at = local;
    }
    if (!(m->length > 0.0) || local - m->start < m->length) {
        return 0;
    }
    double *kept = m->minimum + 2 * (m->n % SB_MINIMA);
    kept[0] = m->at;
    kept[1] = m->least;
    m->n++;
    m->start = m->at = local;
    m->least = offset;
    return 1;
}

/* --- the rate of the clock ------------------------------------------------------------------------------------------ */

/* The straight line through minima: its value at time 0 and its slope; then how far they are from it at most, below and
   above. */
static void fit_line(const double *minimum, double *line, double *below, double *above) {
    double time = 0.0, value = 0.0, square = 0.0, product = 0.0;
    for (int k = 0; k < SB_MINIMA; k++) {
        time += minimum[2 * k] / SB_MINIMA;
        value += minimum[2 * k + 1] / SB_MINIMA;
    }
    for (int k = 0; k < SB_MINIMA; k++) {
        square += (minimum[2 * k] - time) * (minimum[2 * k] - time);
        product += (minimum[2 * k] - time) * (minimum[2 * k + 1] - value);
    }
    line[1] = square > 0.0 ? product / square : 0.0;
    line[0] = value - line[1] * time;
    *below = *above = 0.0;
    for (int k = 0; k < SB_MINIMA; k++) {
        const double rest = minimum[2 * k + 1] - line[0] - line[1] * minimum[2 * k];
        *below = rest < *below ? rest : *below;
        *above = rest > *above ? rest : *above;
    }
}

static void turn_minima(SbMinima *m, double slope) {
    for (int k = 0; k < SB_MINIMA; k++) {
        m->minimum[2 * k + 1] -= slope * m->minimum[2 * k];
        m->minimum[2 * k] *= 1.0 - slope;
    }
    m->least -= slope * m->at;
    m->at *= 1.0 - slope;
    m->start *= 1.0 - slope;
}

static void turn_model(SbModel *m, double slope) {
    m->floor -= slope * m->local;
    m->lowest -= slope * m->local;
    m->fastest -= slope * m->start; /* the fastest clock is as fast as before, by the tolerance from the new pace */
    m->local *= 1.0 - slope;
    m->start *= 1.0 - slope;
}

/* Take the slope of the smallest delays for the rate of the clock: if they lie on a line, over all windows that are kept,
   and the rate is one that is tolerated. At first the rate is only followed: it removes the growth from the age, and what
   a queue may have hidden stays in the uncertainty. A delay that grows steadily over the windows of the measurement counts
   as rate. From then on the clock may differ from it by what oscillators wander, and hidden delay is counted from here. */
static void follow_rate(SbClock *c, const SbMinima *minima, int is_measured) {
    double line[2], below, above;
    if (minima->n < SB_MINIMA) {
        return;
    }
    fit_line(minima->minimum, line, &below, &above);
    const double pace = c->pace * (1.0 - line[1]);
    if (!(above - below <= c->straight) || fabs(pace - c->stated) > c->tolerance) {
        return;
    }
    SbModel *m = &c->known;
    const double age = m->local - m->source - m->floor;
    c->pace = pace;
    c->jumped.is_set = 0;
    turn_minima(&c->drift, line[1]);
    turn_minima(&c->rate, line[1]);
    turn_model(m, line[1]);
    turn_model(&c->before, line[1]);
    const double delay = m->local - m->source, floor = line[0] + below;
    m->floor = m->lowest = delay < floor ? delay : floor;
    if (is_measured) {
        c->is_learned = 1;
        m->fastest = m->floor - 4.0 * (above - below); /* a bend that stays within this may hide as much */
        m->start = m->local;
    }
    count_turn(&c->count, age, m, delay - m->floor);
}

/* --- restarts --------------------------------------------------------------------------------------------------------- */

/* Follow the clock of a sender that has been restarted, and keep the clock of before. */
static void replace(SbClock *c, const SbModel *old, SbModel made, double local) {
    /* A queue on the way outlives a restart of the sender: what may hide in it still may. */
    made.lowest -= old->floor - old->lowest;
    made.doubt = old->floor - old->fastest + tolerance_of(c) * (local - old->start) + old->doubt + old->either;
    c->known = made;
    c->before = *old;
    c->jumped.is_set = 0;
    begin_drift(c, local, c->known.floor);
}

/* Take in a sample time that does not fit. Cycles that were held back come one behind the other, each a cycle less late
   than the one before. */
static int64_t take_jump(SbClock *c, double local, int64_t ticks, int64_t counter) {
    double offset;
    const int in_a_row = c->jumped.is_set && local - c->jumped.local <= CONFIRMED_WITHIN * c->jump_tolerance;
    if (!in_a_row || !follow(c, &c->jumped, local, ticks, c->steady, &offset)) {
        c->jumped = new_model(c, local, ticks, counter);
    }
    if (c->jumped.readings < c->confirmations) {
        return SB_JUMPED;
    }
    SbModel old = c->before.is_set ? c->before : c->known;
    if (!c->before.is_set) {
        old.doubt += c->count.doubt;
        c->count_before = c->count;
        old.counter = c->count.is_set ? c->count.last : -1;
    }
    replace(c, &old, c->jumped, local);
    count_take(&c->count, c->tick, &c->known, 0.0, 0.0, counter);
    return SB_JUMPED | SB_RESTARTED;
}

void clock_begin(SbClock *c, const SbModel *old, double local, int64_t ticks) {
    c->age = c->uncertainty = 0.0;
    replace(c, old, new_model(c, local * c->pace, ticks, -1), local * c->pace);
}

/* The last strains before the restart were sampled at `earliest` or later, those behind it after them. A clock that began
   after them shows how long after; where the counter continues, its steps do. From the first reading behind the restart to
   this one the counter shows the time too. */
void clock_bound_restart(SbClock *c, int evidence, int64_t counter) {
    const SbModel *old = &c->before;
    SbModel *m = &c->known;
    if (!old->is_set || c->is_synchronised) {
        return;
    }
    const double hidden = tolerance_of(c) * (old->local - old->start) + old->doubt + old->either;
    const double earliest = old->source + old->fastest - hidden;
    double passed = m->source - m->begin; /* since the first reading */
    if (c->count.modulus > 0 && m->counter >= 0 && counter >= 0) {
        const double counted = c->count.period * (double)forward(counter - m->counter, c->count.modulus);
        passed = counted < passed ? counted : passed;
        if (evidence == CLOCK_COUNTER_CONTINUES && old->counter >= 0) {
            const double before = c->count.period * (double)forward(m->counter - old->counter, c->count.modulus);
            passed += before <= m->floor + m->begin - old->local + c->count.period ? before : 0.0;
        }
    }
    if (evidence == CLOCK_BEGAN) {
        passed += m->begin;
        const double ahead = (double)wrapped((uint64_t)m->ticks - (uint64_t)old->ticks, c->bits) * c->tick;
        passed = ahead >= 0.0 && ahead < passed ? ahead : passed; /* it may be a time of the clock before, too */
    }
    const double age = m->local - earliest - passed, stated = m->local - m->source - m->floor;
    m->doubt = age > stated ? age - stated : 0.0;
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

int64_t clock_read(SbClock *c, double local, int64_t ticks, int64_t counter) {
    const double now = local * c->pace, floor = c->known.floor;
    double offset;
    c->age = c->uncertainty = 0.0;
    if (c->is_synchronised) {
        return read_synchronised(c, local, ticks);
    }
    if (!c->known.is_set) {
        c->known = new_model(c, now, ticks, counter);
        begin_drift(c, now, c->known.floor);
        return reading_of(c, c->known.floor, counter);
    }
    if (follow(c, &c->known, now, ticks, 1.0, &offset)) {
        double steady; /* the reading may be of the clock that has jumped, too: then it has no age */
        if (c->jumped.is_set && follow(c, &c->jumped, now, ticks, c->steady, &steady)) {
            c->known.either += now - c->known.source - c->known.floor;
        }
        c->jumped.is_set = 0;
        const int64_t flags = reading_of(c, floor, counter);
        const int has_drift = keep_minimum(&c->drift, now, offset);
        if (keep_minimum(&c->rate, now, offset)) {
            follow_rate(c, &c->rate, 1);
        }
        if (has_drift && c->rate.length > 0.0 && !c->is_learned) {
            follow_rate(c, &c->drift, 0);
        }
        return flags;
    }
    if (c->before.is_set && follow(c, &c->before, now, ticks, 1.0, &offset)) {
        c->known = c->before;
        c->known.doubt -= c->count_before.is_set ? c->count_before.doubt : 0.0;
        c->before.is_set = c->jumped.is_set = 0;
        begin_drift(c, now, c->known.floor);
        c->count = c->count_before;
        return reading_of(c, c->known.floor, counter) | SB_RESUMED;
    }
    return take_jump(c, now, ticks, counter);
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

int64_t sb_clock_read(SbClock *clock, const double *local, const int64_t *ticks, const int64_t *counter) {
    return clock_read(clock, *local, *ticks, *counter);
}

void sb_clock_reset(SbClock *clock) {
    clock->known.is_set = clock->jumped.is_set = clock->before.is_set = 0;
    begin_drift(clock, INFINITY, INFINITY);
}
