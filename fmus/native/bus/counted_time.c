#include "counted_time.h"

#include <math.h>

#include "rounding.h"

enum { FIRST_INTERVALS = 16, INTERVALS = 64 };
enum { NOT_MEASURED, DOUBTFUL, MEASURED };

/* Part of a period within which an interval is regular, and for each of its cycles; part of a measurement that counts; part
   of a period within which arrivals confirm the counter. */
static const double REGULAR = 0.02, PER_STEP = 1e-3, GAIN = 0.125, CONFIRMED = 0.5;

static double smaller(double a, double b) {
    return a < b ? a : b;
}

static double larger(double a, double b) {
    return a > b ? a : b;
}

static void begin_measurement(SbCount *c) {
    c->n = c->n_odd = c->steps = c->regular_steps = c->early_steps = c->late_steps = 0;
    c->regular = 0.0;
    c->begin = c->source;
}

static void begin(SbCount *c, const SbModel *m, double age, int64_t counter) {
    c->is_set = 1;
    c->is_irregular = 0;
    c->last = counter;
    c->source = m->source;
    c->local = m->local;
    c->earliest = c->latest = m->local - age;
    c->kept = c->doubt = 0.0;
    begin_measurement(c);
}

/* Cycles since the last reading; the time says how often the counter has wrapped. */
static int64_t steps_since(const SbCount *c, double passed, int64_t counter) {
    const int64_t steps = ((counter - c->last) % c->modulus + c->modulus) % c->modulus;
    const double wraps = (passed / c->period - (double)steps) / (double)c->modulus;
    return steps + (wraps > 0.5 ? whole_number(wraps) * c->modulus : 0);
}

/* End a measurement of the period. A sender most of whose intervals are regular has a period; single steps of its clock do
   not count in it. Without regular intervals, in two measurements of a sender that had a period, the counter shows no time:
   it is compared again from here on, and what was in doubt before stays so. */
static void measure(SbCount *c, double age) {
    const double period = c->regular_steps > 0 ? c->regular / (double)c->regular_steps : c->period;
    if (4 * c->n_odd <= c->n) {
        if (c->is_measured == NOT_MEASURED) {
            c->earliest += (double)c->early_steps * (period - c->period);
            c->latest += (double)c->late_steps * (period - c->period);
            c->period = period;
        } else {
            c->period += GAIN * (period - c->period);
        }
        c->is_measured = MEASURED;
        c->is_irregular = 0;
    } else if (c->is_measured == MEASURED) {
        c->is_measured = DOUBTFUL;
    } else {
        c->kept = c->is_measured == DOUBTFUL ? c->doubt : c->kept;
        c->period = (c->source - c->begin) / (double)c->steps;
        c->is_measured = NOT_MEASURED;
        c->is_irregular = 1;
        c->earliest = c->latest = c->local - age;
    }
    begin_measurement(c);
}

/* Advance the bounds by a cycle whose counter and clock show different times. The clock was set, or the counter jumped:
   where the counter is ahead and arrivals do not confirm it, only one cycle is certain. */
static void advance_odd(SbCount *c, double passed, double elapsed, double expected, int64_t steps) {
    if (expected > passed && fabs(elapsed - expected) > CONFIRMED * c->period) {
        c->earliest += smaller(passed, c->period);
    } else {
        c->earliest += expected;
        c->early_steps += steps;
    }
    if (expected > passed) {
        c->latest += expected;
        c->late_steps += steps;
    } else {
        c->latest += passed;
    }
}

void count_take(SbCount *count, double tick, const SbModel *m, double age, double raised, int64_t counter) {
    SbCount *c = count;
    if (c->modulus == 0 || counter < 0) {
        c->is_set = 0;
        c->doubt = 0.0;
        return;
    }
    if (!c->is_set) {
        begin(c, m, age, counter);
        return;
    }
    const double passed = m->source - c->source, elapsed = m->local - c->local;
    const int64_t steps = steps_since(c, passed, counter);
    const double expected = (double)steps * c->period;
    const int is_odd = fabs(passed - expected) > REGULAR * c->period + PER_STEP * expected + 2.0 * tick;
    c->last = counter;
    c->source = m->source;
    c->local = m->local;
    c->steps += steps;
    c->n++;
    if (is_odd && !c->is_irregular) {
        advance_odd(c, passed, elapsed, expected, steps);
    } else {
        c->earliest += expected;
        c->latest += expected;
        c->early_steps += steps;
        c->late_steps += steps;
    }
    if (is_odd) {
        c->n_odd++;
    } else {
        c->regular += passed;
        c->regular_steps += steps;
    }
    if (c->n >= (c->is_measured == MEASURED ? INTERVALS : FIRST_INTERVALS) && c->steps > 0 && c->source > c->begin) {
        measure(c, age);
    }
    /* What the clock is allowed to lag counts for both; no strains come before they are sampled. */
    c->earliest = smaller(c->earliest + raised, c->local);
    c->latest = smaller(c->latest + raised, c->local);
    const double older = c->local - c->earliest - age, younger = age - (c->local - c->latest);
    c->doubt = c->kept + larger(0.0, larger(older, younger));
}

void count_turn(SbCount *c, double age_before, const SbModel *m, double age) {
    const double older = c->local - age_before - c->earliest, younger = c->latest - (c->local - age_before);
    c->local = m->local;
    c->earliest = c->local - age - older;
    c->latest = c->local - age + younger;
}
