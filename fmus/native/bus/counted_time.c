#include "counted_time.h"

#include <math.h>

#include "rounding.h"

enum { FIRST_INTERVALS = 16, INTERVALS = 64 };

/* Part of a period within which an interval is regular, and for each of its cycles; part of a measurement that counts. */
static const double REGULAR = 0.02, PER_STEP = 1e-3, GAIN = 0.125;

static void begin_measurement(SbCount *c) {
    c->n = c->n_odd = c->steps = c->regular_steps = 0;
    c->regular = 0.0;
    c->begin = c->source;
}

static void begin(SbCount *c, const SbModel *m, int64_t counter) {
    c->is_set = 1;
    c->last = counter;
    c->source = c->counted = m->source;
    c->local = m->local;
    c->floor = m->floor;
    c->doubt = 0.0;
    begin_measurement(c);
}

/* Cycles since the last reading; the time says how often the counter has wrapped. */
static int64_t steps_since(const SbCount *c, double passed, int64_t counter) {
    const int64_t steps = ((counter - c->last) % c->modulus + c->modulus) % c->modulus;
    const double wraps = (passed / c->period - (double)steps) / (double)c->modulus;
    return steps + (wraps > 0.5 ? whole_number(wraps) * c->modulus : 0);
}

/* End a measurement of the period. A sender most of whose intervals are regular has a period; single steps of its clock do
   not count in it. Without regular intervals the counter shows no time: it is compared again from here on. */
static void measure(SbCount *c, double local, double age) {
    if (4 * c->n_odd > c->n) {
        c->period = (c->source - c->begin) / (double)c->steps;
        c->is_measured = 0;
        c->counted = local - c->floor - age;
    } else {
        const double period = c->regular / (double)c->regular_steps;
        if (!c->is_measured) {
            c->period = period;
            c->counted = c->begin + (double)c->steps * period;
        } else {
            c->period += GAIN * (period - c->period);
        }
        c->is_measured = 1;
    }
    begin_measurement(c);
}

void count_take(SbCount *count, double tick, const SbModel *m, double age, double raised, int64_t counter) {
    SbCount *c = count;
    if (c->modulus == 0 || counter < 0) {
        c->is_set = 0;
        c->doubt = 0.0;
        return;
    }
    if (!c->is_set) {
        begin(c, m, counter);
        return;
    }
    const double passed = m->source - c->source, elapsed = m->local - c->local;
    const int64_t steps = steps_since(c, passed, counter);
    const double expected = (double)steps * c->period;
    const int is_odd = fabs(passed - expected) > REGULAR * c->period + PER_STEP * expected + 2.0 * tick;
    /* Arrivals show which of both has jumped. A jump of the counter shows nothing about time. */
    const int has_jumped = is_odd && fabs(elapsed - passed) < fabs(elapsed - expected) && expected > passed;
    c->last = counter;
    c->source = m->source;
    c->local = m->local;
    c->counted += has_jumped ? passed : expected;
    c->steps += steps;
    c->n++;
    if (is_odd) {
        c->n_odd++;
    } else {
        c->regular += passed;
        c->regular_steps += steps;
    }
    if (c->n >= (c->is_measured ? INTERVALS : FIRST_INTERVALS) && c->steps > 0 && c->source > c->begin) {
        measure(c, m->local, age);
    }
    const double delay = m->local - c->counted;
    c->floor += raised;
    c->floor = delay < c->floor ? delay : c->floor;
    c->doubt = fabs(delay - c->floor - age);
}
