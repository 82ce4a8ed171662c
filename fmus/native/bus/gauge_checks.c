#include <math.h>

#include "freeze_watch.h"
#include "rounding.h"

static double larger(double a, double b) {
    return a > b ? a : b;
}

/* The time [s] of whole periods that are missing in the time between two frames; 0 where it is not known. */
static double lost_time(double pause, double period) {
    if (!(pause > 1.4 * period)) {
        return 0.0; /* the nearest number of periods is at most 1; most cycles need no division */
    }
    return (nearest(pause / period) - 1.0) * period;
}

/* Find gauges that have repeated their reading too often. Readings count, not the time: in a pause a healthy gauge
   gives none that could differ. */
static void find_stuck(SbChecks *c, const SbCycle *cycle, double now) {
    for (int64_t i = 0; i < c->n; i++) {
        c->stuck[i] = 0;
        if (!cycle->present[i]) {
            continue;
        }
        const double lost = lost_time(now - c->heard[i], c->period[i]);
        if (c->seen[i] && cycle->raw[i] == c->last_raw[i]) {
            c->repeats[i]++;
            c->stuck[i] = (double)c->repeats[i] >= c->stuck_cycles[i];
        } else {
            c->repeats[i] = 0;
            c->changed[i] = now;
            c->unheard[i] = lost;
        }
        c->heard[i] = now;
        c->last_raw[i] = cycle->raw[i];
        c->seen[i] = 1;
    }
}

/* Whether a gauge at exactly zero has fallen to it, or been there for too long. Amplifiers send zero on an error (HBK
   QuantumX: default for integers). A strain that passes through zero may well meet it: only a fall faster than its own
   pace counts at once. */
static int is_fault_of_zero(SbChecks *c, int64_t i, double strain) {
    const double usual = c->zero_jump + c->pace_factor * c->pace[i] * c->cycles_apart[i];
    return fabs(strain - c->last_good[i]) > usual || c->zeros[i] >= c->zero_cycles[i];
}

/* Count the zeros in a row; with an offset, raw zero and strain zero differ, and both count. */
static int64_t find_zeros(SbChecks *c, const SbCycle *cycle) {
    uint8_t *fault = c->fault + SB_ZERO * c->n;
    int64_t any_present = 0, all_zero = 1;
    for (int64_t i = 0; i < c->n; i++) {
        fault[i] = 0;
        if (!cycle->present[i]) {
            continue;
        }
        any_present = 1;
        if (cycle->raw[i] == 0 || fabs(cycle->strain[i]) <= c->round_off) {
            c->zeros[i]++;
            fault[i] = (uint8_t)is_fault_of_zero(c, i, cycle->strain[i]);
        } else {
            c->zeros[i] = 0;
            all_zero = 0;
        }
    }
    return any_present && all_zero;
}

/* Keep a good strain and its rate of change [m/m per cycle]; the first good strain has none. */
static void keep_pace(SbChecks *c, int64_t i, double strain, double now) {
    const double change = fabs(strain - c->last_good[i]), since = now - c->good_time[i];
    const double faded = c->fading * c->pace[i];
    if (change > faded) { /* a smaller change has a smaller pace, whatever the time: it needs no division */
        const double pace = since > c->cycle_time ? change / (since / c->cycle_time) : change;
        c->pace[i] = larger(pace, faded);
    } else if (change <= faded) {
        c->pace[i] = faded;
    }
    c->last_good[i] = strain;
    c->good_time[i] = now;
}

/* The verdict on one gauge by all that was found of it. A bad one is used again after heal_cycles good values. */
static uint8_t judge_gauge(SbChecks *c, const SbCycle *cycle, int64_t i, double now) {
    if (!cycle->present[i]) {
        return 0;
    }
    const double strain = cycle->strain[i];
    int bad = cycle->refused[i] || !isfinite(strain);
    for (int64_t k = 0; k < SB_N_FAULTS; k++) {
        bad |= c->fault[k * c->n + i];
    }
    if (isfinite(strain)) {
        c->last_strain[i] = strain;
    }
    if (bad) {
        c->good[i] = 0;
        return 0;
    }
    c->good[i]++;
    keep_pace(c, i, strain, now);
    return c->good[i] >= c->heal_cycles;
}

int64_t sb_checks_update(SbChecks *checks, const SbCycle *cycle, const double *now) {
    SbChecks *c = checks;
    for (int64_t i = 0; i < c->n; i++) {
        c->difference[i] = cycle->strain[i] - c->last_strain[i];
    }
    find_stuck(c, cycle, *now);
    if (sb_watch_scatter(c->watch, c->difference, c->repeats)) {
        return SB_LEARNED;
    }
    return sb_checks_end(c, cycle, now);
}

int64_t sb_checks_end(SbChecks *checks, const SbCycle *cycle, const double *now) {
    SbChecks *c = checks;
    const int64_t n = c->n;
    const int64_t frozen =
        sb_watch_find(c->watch, cycle->strain, c->repeats, cycle->present) && c->looks_for_frozen;
    for (int64_t i = 0; i < n; i++) {
        c->fault[SB_OUT_OF_RANGE * n + i] = !(fabs(cycle->strain[i]) <= c->sensor_range);
        c->fault[SB_JUMPS * n + i] = fabs(c->difference[i]) > c->rate_limit;
        c->fault[SB_FROZEN * n + i] = c->stuck[i] || (frozen && c->watch->found[i]);
    }
    int64_t flags = (frozen ? SB_HAS_FROZEN : 0) | (find_zeros(c, cycle) ? SB_ALL_ZERO : 0) | SB_ALL_VALID;
    for (int64_t i = 0; i < n; i++) {
        c->valid[i] = judge_gauge(c, cycle, i, *now);
        flags &= c->valid[i] ? ~0 : ~SB_ALL_VALID;
    }
    return flags;
}

static double power(double base, int64_t exponent) {
    double result = 1.0;
    for (; exponent > 0; exponent /= 2, base *= base) {
        result *= exponent % 2 ? base : 1.0;
    }
    return result;
}

static void count_cycle(SbChecks *c, double is_unchanged) {
    c->unchanged += (is_unchanged - c->unchanged) / c->memory;
    c->memory += c->memory < c->memory_length ? 1.0 : 0.0;
}

/* Learn in how many cycles no gauge changes, from runs of them that are over; one that lasts may be a frozen sender. */
static void learn_unchanged(SbChecks *c, int64_t run) {
    if (run == 0) {
        for (int64_t k = 0; k < c->last_run && c->last_run <= c->watch->alive; k++) {
            count_cycle(c, 1.0);
        }
        count_cycle(c, 0.0);
    }
    c->last_run = run;
}

/* Whether all gauges may repeat their readings `run` times by chance: by their noise, and by how often they have done so.
   Noise is underestimated where gauges lie in the middle of a step. What has been seen counts by its root, as cycles
   without a change come in groups where the load drifts. */
static int may_be_chance(const SbChecks *c, const SbCycle *cycle, int64_t run) {
    return run == 0 || (power(c->unchanged, run) >= c->rare &&
                        watch_may_be_chance(c->watch, cycle->strain, cycle->present, NULL, run));
}

void sb_checks_frozen(SbChecks *checks, const SbCycle *cycle, const double *now) {
    SbChecks *c = checks;
    const uint8_t *present = cycle->present;
    double known = INFINITY, possible = INFINITY, fast = INFINITY, youngest = INFINITY;
    int64_t run = INT64_MAX, shortest = INT64_MAX;
    for (int64_t i = 0; i < c->n; i++) {
        if (!present[i]) {
            continue;
        }
        /* By our clock, which lost cycles do not shorten; of cycles without sample time also by their number, which those
           held back do not shorten. */
        const double counted = c->is_dated ? 0.0 : (double)c->repeats[i] * c->period[i];
        const double since = larger(*now - c->changed[i], counted);
        const double repeated = since + (c->repeats[i] > 0 ? c->unheard[i] : 0.0);
        known = repeated < known ? repeated : known;
        youngest = since < youngest ? since : youngest;
        possible = since + c->unheard[i] < possible ? since + c->unheard[i] : possible;
        shortest = c->repeats[i] < shortest ? c->repeats[i] : shortest;
        if (c->is_fast[i]) {
            fast = repeated < fast ? repeated : fast;
            run = c->repeats[i] < run ? c->repeats[i] : run;
        }
    }
    if (known == INFINITY) {
        c->frozen_for[0] = c->frozen_for[1] = c->frozen_for[2] = 0.0;
        c->may_be_chance = 1;
        return;
    }
    learn_unchanged(c, shortest);
    /* Lost cycles are no repetitions: what they make old is no chance. */
    const int is_received = known <= 1.4 * (double)shortest * c->cycle_time;
    c->may_be_chance = may_be_chance(c, cycle, shortest) && is_received;
    /* A slow gauge that has just come is not newer than fast ones that have not changed for cycles. */
    if (run != INT64_MAX && run > 0 && !watch_may_be_chance(c->watch, cycle->strain, present, c->is_fast, run)) {
        known = larger(known, fast);
        c->may_be_chance = 0;
    }
    c->frozen_for[0] = known;
    c->frozen_for[1] = larger(possible - known, 0.0);
    c->frozen_for[2] = larger(known - youngest, 0.0);
}
