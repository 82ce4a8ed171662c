/* Each gauge by its values: no value, range, jump, exactly zero, stuck; and gauges that are frozen together.

   A healthy gauge repeats its reading by chance. Let c be the probability that a reading differs from the one before. m
   repetitions in a row have the probability (1 - c)^m: a gauge is stuck where that is below RARE.

   c is what has been measured of a gauge that has changed at least twice, and never more than its stated noise gives: rigs
   are quieter than stated. While all repeat their readings more often than noise allows, nothing is measured. A gauge that
   has not changed teaches nothing about itself, or one that is stuck from the start would be taken for a quiet one. Its c is
   the smallest of its living neighbours, and before there are any a START that the quietest rig of use has.

   Of the n gauges of a frame, or of all, k have repeated their readings at least m times. Healthy ones do so with a
   probability of at most C(n, k) times the product of their (1 - c)^m. Below CHANCE they are frozen. */

#include <math.h>

#include "../core/elementary.h"
#include "signals.h"

enum { SHORTEST_STUCK = 25, SHORTEST_ZERO = 5, FIRST_LEARN = 32, LATER_LEARN = 256, MEMORY = 2048 };

static const double LN_RARE = -20.72, LN_CHANCE = -27.63, LN_DOUBT = -9.21; /* ln 1e-9, ln 1e-12, ln 1e-4 */
static const double START = 0.02, SMALLEST_CHANGE = 1e-5;
static const double LN_2 = 0.6931471805599453, LARGEST_CHOICE = 40.0;
static const double ROUND_OFF = 1e-15;       /* of scale and offset, on exactly zero [m/m] */
static const double PACES = 3.0, FADING = 0.9; /* plausible fall to zero in changes of one cycle; factor per cycle on it */
static const int RUNS[] = {3, 8, 25};         /* an amplifier may sample at one third of the rate at which it sends */

/* --- what a gauge does by chance ---------------------------------------------------------------------------------------- */

static double smaller(double a, double b) { return a < b ? a : b; }
static double larger(double a, double b) { return a > b ? a : b; }

/* Derive from what has been seen how often readings repeat, and how often in a row is too often. */
static void learn(const SbPlan *p, SbState *s) {
    SbGauge *g = gauges_of(s);
    double of_living = INFINITY;
    for (int i = 0; i < p->n_gauges; i++) {
        if (g[i].changes >= 2.0) {
            of_living = smaller(of_living, g[i].changes / (g[i].readings + 3.0));
        }
    }
    for (int i = 0; i < p->n_gauges; i++) {
        const int is_living = g[i].changes >= 2.0;
        const double seen = is_living ? g[i].changes / (g[i].readings + 3.0) : of_living < INFINITY ? of_living : START;
        const double change = larger(smaller(seen, p->change[i]), SMALLEST_CHANGE);
        g[i].log_repeat = logarithm(1.0 - smaller(change, 0.99));
        const double longest = LN_RARE / g[i].log_repeat;
        g[i].stuck_limit = p->stuck > 0 ? p->stuck : p->stuck == 0 ? INFINITY : larger(longest, SHORTEST_STUCK);
        g[i].zero_limit = larger(longest, is_living ? SHORTEST_ZERO : SHORTEST_STUCK);
        if (g[i].readings >= MEMORY) {
            g[i].readings *= 0.5;
            g[i].changes *= 0.5;
        }
    }
    s->learn_at = s->cycles + (s->cycles < MEMORY / 4 ? FIRST_LEARN : LATER_LEARN);
}

void gauges_begin(const SbPlan *p, SbState *s) {
    SbGauge *g = gauges_of(s);
    for (int i = 0; i < p->n_gauges; i++) {
        g[i].last = g[i].last_good = NAN;
        g[i].good = p->heal;
        g[i].reason = SB_NO_FRAME;
    }
    learn(p, s);
    s->changed_at = -INFINITY;
}

/* --- one gauge ------------------------------------------------------------------------------------------------------------ */

/* Keep a good strain and its rate of change [m/m per cycle]. */
static void keep_pace(const SbPlan *p, SbGauge *g, double strain, double now) {
    const double change = fabs(strain - g->last_good), since = (now - g->good_time) / p->cycle;
    g->pace = larger(change / larger(since, 1.0), FADING * g->pace); /* the first good strain has none: NaN is not above */
    g->last_good = strain;
    g->good_time = now;
}

/* Whether a gauge at exactly zero has fallen to it, or been there for too long. Amplifiers send zero on an error (HBK
   QuantumX: default for integers). A strain that passes through zero may well meet it: only a fall faster than its own pace
   counts at once. */
static int is_fault_of_zero(const SbPlan *p, SbGauge *g, double strain, double cycles_apart) {
    const double usual = p->zero_jump + PACES * g->pace * cycles_apart;
    g->zeros++;
    return fabs(strain - g->last_good) > usual || g->zeros >= g->zero_limit;
}

/* Take in a reading; the fault that it shows, SB_IS_USED for none. */
static int read_gauge(const SbPlan *p, const SbSlot *t, SbGauge *g, const SbSignal *signal, int64_t raw, int refuse_all,
                      int teaches) {
    const double value = signal_value(signal, raw), strain = value * signal->factor;
    const double change = strain - g->last;
    if (signal_is_code(p, signal, raw) || strain != strain) { /* it says nothing about the gauge */
        g->run = g->zeros = 0;
        return SB_NO_VALUE;
    }
    const int has_value = !refuse_all && !signal_is_outside(signal, raw, value);
    const int is_at_zero = raw == 0 || fabs(strain) <= ROUND_OFF;
    const int repeats = g->is_seen && raw == g->last_raw;
    g->run = repeats ? g->run + 1 : 0;
    if (teaches && g->is_seen && g->run < g->stuck_limit) {
        g->readings += 1.0;
        g->changes += !repeats;
    }
    const int is_stuck = g->run >= g->stuck_limit;
    const int is_zero = is_at_zero && is_fault_of_zero(p, g, strain, t->period / p->cycle);
    g->zeros = is_at_zero ? g->zeros : 0;
    g->last_raw = raw;
    g->last = strain;
    g->is_seen = 1;
    return !has_value                           ? SB_NO_VALUE
           : !(fabs(strain) <= p->sensor_range) ? SB_OUT_OF_RANGE
           : fabs(change) > p->rate_limit       ? SB_JUMPS
           : is_stuck                           ? SB_IS_FROZEN
           : is_zero                            ? SB_ZERO
                                                : SB_IS_USED;
}

/* --- gauges together -------------------------------------------------------------------------------------------------------- */

/* Gauges of a frame, or of all: how many have repeated their readings at least m times. */
typedef struct {
    int n, k;
    double log_probability;
} Group;

static int is_frozen(const Group *group) {
    const double choice = group->k < group->n ? smaller(group->n * LN_2, LARGEST_CHOICE) : 0.0;
    return group->k >= 2 && group->log_probability + choice < LN_CHANCE;
}

/* Mark gauges of a frame, or of all (slot < 0), that have repeated their readings at least m times. */
static void mark_frozen(const SbPlan *p, SbState *s, int slot, int m) {
    for (Reading r = {0}; next_reading(p, s, &r);) {
        if ((slot < 0 || r.slot == slot) && r.state->present && r.gauge->run >= m && r.gauge->reason == SB_IS_USED) {
            r.gauge->reason = SB_IS_FROZEN;
        }
    }
}

/* Mark gauges that are frozen together, of a frame or all; SB_FROZEN if there are any. */
static uint32_t find_frozen(const SbPlan *p, SbState *s, int m) {
    Group all = {0, 0, 0.0};
    uint32_t causes = 0;
    for (int i = 0; i < p->n_slots; i++) {
        const SbSlot *t = &p->slot[i];
        Group own = {0, 0, 0.0};
        for (int k = t->first; t->kind <= SB_HELD && k < t->first + t->n_signals; k++) {
            const SbGauge *g = &gauges_of(s)[p->signal[k].target];
            if (g->run >= m && slots_of(s)[i].present) {
                own.k++;
                own.log_probability += m * g->log_repeat;
                all.log_probability += m * g->log_repeat;
            }
        }
        own.n = t->kind <= SB_HELD ? t->n_signals : 0;
        all.n += own.n;
        all.k += own.k;
        if (is_frozen(&own)) {
            mark_frozen(p, s, i, m);
            causes = SB_FROZEN;
        }
    }
    if (is_frozen(&all)) {
        mark_frozen(p, s, -1, m);
        causes = SB_FROZEN;
    }
    return causes;
}

/* --- all -------------------------------------------------------------------------------------------------------------------- */

/* Whether all gauges read exactly zero although there is a load: one of them has fallen to it, or none has ever changed. */
static int are_dead(const SbPlan *p, const SbState *s, double now) {
    double largest = 0.0, changes = 0.0;
    for (int i = 0; i < p->n_gauges; i++) {
        changes += gauges_of(s)[i].changes;
        const double last = fabs(gauges_of(s)[i].last_good);
        largest = last > largest ? last : largest;
    }
    return stated_pressure(p, s, now) > 0.0 && (largest > p->zero_jump || changes == 0.0);
}

/* The time since the last change [s], at least and at most: by our clock and by the sample times. Frames may have been held
   back meanwhile, or the sender's clock set. */
static void unchanged_for(const SbPlan *p, const SbState *s, int64_t ticks, double *least, double *most) {
    const double since = s->first - s->changed_at;
    const int is_dated = ticks >= 0 && s->changed_ticks >= 0;
    const double by_clock = is_dated ? seconds_ahead(ticks, s->changed_ticks, p->bits, p->tick, since) : since;
    *least = larger(smaller(since, by_clock), 0.0);
    *most = larger(since, by_clock);
}

/* What a cycle's readings show together. */
typedef struct {
    int n_present, n_fresh, n_zero, n_running, shortest; /* frames' gauges; repetitions in a row of all */
    double log_repeat;                                   /* ln of the probability that all repeat once */
} Readings;

/* Read the gauges of the frames that are new. */
static Readings read_gauges(const SbPlan *p, SbState *s, int refuse_all) {
    Readings all = {.shortest = INT32_MAX};
    for (Reading r = {0}; next_reading(p, s, &r);) {
        SbGauge *g = r.gauge;
        if (!r.state->present) {
            continue;
        }
        all.n_present++;
        if (r.state->fresh) {
            const int64_t raw = signal_raw(r.signal, data_of(s) + r.frame->data);
            g->reason = read_gauge(p, r.frame, g, r.signal, raw, refuse_all, !s->all_repeat);
            all.n_fresh++;
            all.n_running += g->run >= RUNS[0];
            if (g->is_seen && g->last_raw == raw && r.frame->kind == SB_STRAIN) { /* "no value" says nothing */
                all.shortest = g->run < all.shortest ? g->run : all.shortest;
                all.log_repeat += g->log_repeat;
            }
        }
        all.n_zero += g->is_seen && (g->last_raw == 0 || fabs(g->last) <= ROUND_OFF);
    }
    return all;
}

/* Leave the reason against each gauge, one that heals included; the number of those without any. */
static int state_reasons(const SbPlan *p, SbState *s, int is_dead) {
    int n_used = 0;
    for (Reading r = {0}; next_reading(p, s, &r);) {
        SbGauge *g = r.gauge;
        const int is_present = r.state->present;
        g->reason = is_dead && is_present && g->reason == SB_IS_USED ? SB_ZERO : g->reason;
        if (is_present && r.state->fresh) {
            g->good = g->reason == SB_IS_USED ? g->good + (g->good < p->heal) : 0;
            if (g->reason == SB_IS_USED) {
                keep_pace(p, g, g->last, s->first);
                g->reason = g->good >= p->heal ? SB_IS_USED : SB_HEALING;
            }
        }
        reason_of(s)[r.signal->target] = (uint8_t)g->reason;
        n_used += is_present && g->reason == SB_IS_USED;
    }
    return n_used;
}

/* For how long no gauge has changed, at least, where noise does not allow that, else 0 [s]; `doubted`: and at most beyond it,
   or where noise hardly does. */
static void find_repeats(const SbPlan *p, SbState *s, const Readings *all, int64_t ticks, double *repeated, double *doubted) {
    const int is_read = all->shortest < INT32_MAX, is_repeated = is_read && all->shortest > 0;
    const double chance = all->shortest * all->log_repeat;
    double least = 0.0, most = 0.0;
    if (is_repeated) {
        unchanged_for(p, s, ticks, &least, &most);
    }
    *repeated = chance < LN_CHANCE ? least : 0.0;
    *doubted = chance < LN_DOUBT ? most - *repeated : 0.0;
    s->all_repeat = is_repeated && chance < LN_DOUBT;
    if (is_read && !is_repeated) {
        s->changed_at = s->first;
        s->changed_ticks = ticks;
    }
}

/* Check the gauges of the frames that are new; the reasons against them are left for find_valid, which adds the frames'. */
uint32_t gauges_check(const SbPlan *p, SbState *s, int refuse_all, int64_t ticks, double *repeated, double *doubted) {
    const Readings all = read_gauges(p, s, refuse_all);
    uint32_t causes = 0;
    for (int r = 0; all.n_running >= 2 && p->stuck != 0 && r < 3; r++) {
        causes |= find_frozen(p, s, RUNS[r]);
    }
    const int is_dead = all.n_fresh && all.n_zero == all.n_present && are_dead(p, s, s->first);
    s->all_frozen = state_reasons(p, s, is_dead) == 0 && causes & SB_FROZEN;
    if (all.n_fresh) {
        find_repeats(p, s, &all, ticks, repeated, doubted);
        s->cycles += 1.0;
        if (s->cycles >= s->learn_at) {
            learn(p, s);
        }
    }
    return causes;
}
