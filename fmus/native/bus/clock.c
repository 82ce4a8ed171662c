/* The age of strains by the sample times of their sender.

   Let T be the sender's time of a sample and theta(T) what our time is ahead of its clock then. A frame that comes at `a`
   was sampled before, and what a sender has heard at its time H <= T was sent before at our time `sent`:

       theta <= a - T = upper,        theta >= sent - H = lower.

   Both clocks' rates differ by at most the tolerance r, so that both bounds widen by r each second. A sample has the age

       now - T - upper <= age <= now - T - lower.

   The first is the age of a result, the difference of both its uncertainty. Whatever the clocks do, the age is at most
   now - sent for the result that the state of the same cycle names, because T >= H.

   For how long the result was known at T the sender's clock says, which makes the second bound close. But that clock may
   have been set ahead meanwhile. A step of the counter by n cycles goes with a step of the clock by n periods; by what it is
   longer (`off` > 0), and by cycles that did not come, it may have been set ahead: that time is `unseen`. A longer step
   makes theta smaller, a shorter one larger; both bounds take that in. Where the time goes back, or by more than a period
   off, nothing holds any more.

   A sender that names results needs no other proof: a recording names old ones. The lower bound of a sender that names none
   is an assumption: the path was empty when its clock was first read, or when somebody confirmed it. Then theta = upper, and
   the bound only widens. A time that goes on nowhere, three cycles in a row, is a restart: unproven until somebody confirms
   it, or the sender of before is back: its clock explains what comes, as far as its counter does, too. */

#include <math.h>

#include "bus.h"
#include "rounding.h"

static const double SETTLE = 30.0; /* for which a bound widens where restarts are accepted [s] */
static const double LONGEST_DELAY = 10.0; /* above what a sender can state [s] */
static const double EPSILON = 1e-6;

/* The time of a cycle, or of a frame: the sender's sample time and counter, -1 for none; bits and unit of the former; ours, and
   when it is used. */
typedef struct {
    int64_t ticks;
    int counter, bits;
    double tick, local, now; /* [s] */
} Sample;

/* By how much sample times of `bits` are ahead of others, which wrap. */
int64_t ticks_ahead(int64_t ticks, int64_t than, int bits) {
    const int unused = 64 - bits;
    const uint64_t ahead = ((uint64_t)ticks - (uint64_t)than) << unused;
    return ahead >> 63 ? -(int64_t)((~ahead + 1) >> unused) : (int64_t)(ahead >> unused);
}

/* The same in seconds of a clock that may have wrapped meanwhile: it has gone on for about as long as ours, `passed`. */
double seconds_ahead(int64_t ticks, int64_t than, int bits, double tick, double passed) {
    const double ahead = tick * (double)ticks_ahead(ticks, than, bits), range = tick * power_of_two(bits);
    return ahead + range * (double)whole_number((passed - ahead) / range);
}

static double time_ahead(const Sample *at, int64_t than, double passed) {
    return seconds_ahead(at->ticks, than, at->bits, at->tick, passed);
}

/* --- the step from the cycle before ----------------------------------------------------------------------------------- */

typedef struct {
    double time, off, unseen; /* by the sender's clock; by what it is longer than by its counter, and than one cycle [s] */
    double passed;            /* by ours [s] */
    int steps, goes_on;
} Step;

/* The step to a cycle from one of sample time `ticks` and a counter, which was read at our time `at`. A counter that has gone
   round has its rounds from the time. */
static Step step_from(const SbPlan *p, int64_t ticks, int counter, double at, const Sample *to) {
    const double passed = to->local - at;
    Step step = {.time = time_ahead(to, ticks, passed), .passed = passed};
    if (p->modulus && to->counter >= 0 && counter >= 0) {
        step.steps = (to->counter - counter + p->modulus) % p->modulus;
        const double rounds = (step.time / p->cycle - step.steps) / p->modulus;
        step.steps += rounds > 0.5 && rounds < 1e6 ? p->modulus * (int)(rounds + 0.5) : 0;
        step.off = step.time - step.steps * p->cycle;
    } else { /* our own clock counts */
        const double cycles = passed / p->cycle;
        step.steps = cycles > 0.0 && cycles < 1e9 ? (int)(cycles + 0.5) : 0;
        step.off = step.time > passed + p->cycle ? step.time - passed : 0.0;
    }
    step.goes_on = step.time > 0.0 && fabs(step.off) < p->cycle;
    step.unseen = (step.off > 0.0 ? step.off : 0.0) + (step.steps > 1 ? (step.steps - 1) * p->cycle : 0.0);
    return step;
}

/* The bounds at the reading of a clock, widened since the last one. */
static SbClock widened(const SbPlan *p, const SbClock *clock, const Sample *at) {
    SbClock k = *clock;
    const double passed = at->local > k.at ? at->local - k.at : 0.0;
    k.source += time_ahead(at, k.ticks, at->local - k.at);
    k.upper += p->tolerance * passed;
    k.lower -= p->tolerance * passed;
    k.ticks = at->ticks;
    k.counter = at->counter;
    k.at = at->local;
    return k;
}

static void anchor(SbClock *k, const Sample *at) {
    *k = (SbClock){.is_set = 1, .has_lower = 1, .is_assumed = 1, .ticks = at->ticks, .counter = at->counter,
                   .at = at->local, .upper = at->local, .lower = at->local};
}

/* Age and uncertainty of a result, and causes: certainly too old, or not known well enough. */
static uint32_t state_age(const SbPlan *p, SbResult *r, const SbClock *k, double now) {
    r->age = now - k->source - k->upper;
    r->uncertainty = k->has_lower ? k->upper - k->lower + k->doubt : NAN;
    if (r->age > p->max_age) {
        return SB_OLD;
    }
    return r->age + r->uncertainty <= p->max_age ? 0 : SB_AGE_UNKNOWN;
}

/* Whether a clock explains a reading; `k` is then the clock behind it. */
static int fits(const SbPlan *p, const SbClock *clock, SbClock *k, const Sample *at) {
    *k = widened(p, clock, at);
    const double arrived = at->local - k->source;
    const int is_ahead = arrived < k->lower - k->doubt - p->cycle;
    k->upper = arrived < k->upper ? arrived : k->upper;
    k->lower = k->lower > k->upper ? k->upper : k->lower;
    if (p->accepts && k->lower < k->upper - p->tolerance * SETTLE) {
        k->lower = k->upper - p->tolerance * SETTLE;
    }
    return !is_ahead && at->now - k->source - k->upper <= p->max_age;
}

/* The largest difference of a step by its time and by its counter that says nothing: they usually differ, and many in a row
   change what is usual little. */
static double usual_difference(const SbPlan *p, const SbState *s, double tick) {
    const double most = 0.25 * p->cycle, usual = 5.0 * s->usual_off + 2.5 * tick;
    return usual < most ? usual : most;
}

/* By how much the clock was set in a step, or a sample was late: more than is usual. A counter that ran ahead of both clocks, or
   of ours by more than strains are held, says that one cycle has passed at least. */
static double time_set(const SbPlan *p, const Step *step, double usual) {
    const int agree = fabs(step->time - step->passed) < 0.25 * p->cycle;
    const int is_early = step->steps * p->cycle > step->passed + p->max_age + p->cycle;
    const int ran_ahead = step->off < -0.75 * p->cycle && (agree || is_early);
    const double set = ran_ahead ? step->time - p->cycle : step->off;
    return fabs(set) > usual ? set : 0.0;
}

/* A clock that was set ahead may hide as much delay; one that was set back was ahead by less than it seemed. */
static void add_time_set(SbClock *k, double set) {
    k->doubt = k->doubt + set > 0.0 ? k->doubt + set : 0.0;
    k->upper -= set < 0.0 ? set : 0.0;
}

/* The sender of before is back if its clock explains three cycles in a row, of which the first went on nowhere; `is_odd`: it
   may go on with what came between, which it is ahead of, as the end of a recording leads to the present. Meanwhile nobody
   heard whether its clock was set: its counter shows it. */
static void look_for_proven(const SbPlan *p, SbState *s, const Sample *at, const Step *step, int is_odd) {
    SbClock k;
    if (!s->is_unproven || !s->has_proven) {
        return;
    }
    const int is_explained = fits(p, &s->proven, &k, at);
    k.n_returned = is_explained && (s->proven.n_returned || !step->goes_on || is_odd) ? s->proven.n_returned + 1 : 0;
    if (is_explained) {
        const Step meanwhile = step_from(p, s->proven.ticks, s->proven.counter, s->proven.at, at);
        add_time_set(&k, time_set(p, &meanwhile, usual_difference(p, s, at->tick)));
        s->proven = k;
    } else {
        s->proven.n_returned = 0;
    }
    if (s->proven.n_returned >= p->late_limit) {
        s->clock = s->proven;
        s->clock.n_returned = s->clock.n_odd = 0;
        s->has_proven = s->is_unproven = 0;
    }
}

/* --- a sender that names the results it has heard ------------------------------------------------------------------------ */

static uint32_t date_by_echo(const SbPlan *p, SbState *s, const Sample *at, const Step *step, const Echo *echo) {
    const int has_begun = s->clock.is_set && step->goes_on;
    uint32_t causes = s->clock.is_set && !step->goes_on ? SB_JUMP : 0;
    SbClock k = {.is_set = 1, .ticks = at->ticks, .counter = at->counter, .at = at->local, .upper = INFINITY,
                 .lower = -INFINITY};
    if (has_begun) {
        k = widened(p, &s->clock, at);
        k.lower -= step->unseen;
        k.upper -= step->off < 0.0 ? step->off : 0.0;
    }
    const double arrived = at->local - k.source;
    k.upper = arrived < k.upper ? arrived : k.upper;
    if (echo->is_known) {
        k.doubt = k.is_assumed ? 0.0 : k.doubt;
        const double known = has_begun ? echo->delay - (s->unseen - echo->unseen) : 0.0;
        const double lower = echo->ready - k.source + (known > 0.0 ? known : 0.0);
        k.lower = !k.has_lower || k.is_assumed || lower > k.lower ? lower : k.lower;
        k.has_lower = 1;
        k.is_assumed = 0;
    } else if (!k.has_lower && s->is_confirmed) {
        k.lower = k.upper;
        k.has_lower = k.is_assumed = 1;
    }
    /* The strains that the result answers had come when it was ready: a recording that seems to go on names an older one. */
    const double came = echo->ready - k.source + at->tick * (double)ticks_ahead(at->ticks, echo->ticks, at->bits);
    const int is_older = echo->is_known && k.lower > came + p->cycle;
    if (k.has_lower && !k.is_assumed && (is_older || k.lower > k.upper + EPSILON)) { /* no counter has shown it: only this cycle's hold */
        k.upper = arrived;
        k.lower = echo->is_known ? echo->ready - k.source : -INFINITY;
        k.has_lower = echo->is_known;
        causes |= SB_JUMP;
    }
    k.lower = k.lower > k.upper ? k.upper : k.lower;
    s->clock = k;
    s->is_confirmed = 0;
    return causes | state_age(p, &s->result, &k, at->now);
}

/* --- other senders ---------------------------------------------------------------------------------------------------------- */

static uint32_t date_by_anchor(const SbPlan *p, SbState *s, const Sample *at, const Step *step) {
    SbClock k;
    s->is_confirmed = 0;
    if (!s->clock.is_set) {
        anchor(&s->clock, at);
    }
    const double usual = usual_difference(p, s, at->tick), off = fabs(step->off);
    const double set = s->has_seen ? time_set(p, step, usual) : 0.0;
    if (s->has_seen && step->time > 0.0) {
        s->usual_off += off > usual ? (usual - s->usual_off) / 64.0 : (off - s->usual_off) / 16.0;
    }
    const int is_explained = fits(p, &s->clock, &k, at);
    const int is_late = at->now - k.source - k.upper > p->max_age;
    look_for_proven(p, s, at, step, !is_explained && !is_late);
    if (fits(p, &s->clock, &k, at)) { /* which is the proven sender's where it is back */
        add_time_set(&k, set);
        k.n_odd = 0;
        s->clock = k;
        s->n_late = 0;
        return state_age(p, &s->result, &k, at->now);
    }
    SbClock *c = &s->clock;
    c->doubt += set > 0.0 && (is_late || !p->accepts) ? set : 0.0; /* while cycles are too late */
    c->n_odd = !step->goes_on || (!is_late && !c->n_odd) ? 1 : c->n_odd ? c->n_odd + 1 : 0;
    s->n_late++;
    if (c->n_odd >= p->late_limit) {
        if (!p->accepts) { /* from now on nothing proves that the sender is no recording, or not late */
            s->proven = s->is_unproven ? s->proven : s->clock;
            s->has_proven = s->is_unproven = 1;
        }
        anchor(&s->clock, at);
        s->n_late = 0;
        state_age(p, &s->result, &s->clock, at->now);
        return SB_JUMP | SB_OLD;
    }
    s->result.age = is_late ? at->now - k.source - k.upper : NAN;
    s->result.uncertainty = NAN;
    return SB_OLD | (step->goes_on ? 0 : SB_JUMP);
}

/* --- all --------------------------------------------------------------------------------------------------------------------- */

/* Synchronised clocks: the whole delay is age, and a recording is as old as it is. */
static uint32_t date_by_system_time(const SbPlan *p, SbState *s, const Sample *at) {
    const double range = at->tick * power_of_two(at->bits);
    const double behind = remainder_of(at->local + p->shift - at->tick * (double)at->ticks, range);
    const double delay = behind >= 0.5 * range ? behind - range : behind;
    s->is_confirmed = 0;
    s->result.age = delay + (at->now - at->local);
    s->result.uncertainty = p->synchronised;
    if (delay < -p->synchronised - 1e-3) {
        return SB_OLD | SB_JUMP;
    }
    return s->result.age > p->max_age ? SB_OLD : s->result.age + p->synchronised > p->max_age ? SB_AGE_UNKNOWN : 0;
}

uint32_t clock_date(const SbPlan *p, SbState *s, int64_t ticks, int counter, double tick, const Echo *echo, double now) {
    const Sample at = {ticks, counter, p->bits, tick, s->first, now};
    const Step none = {.goes_on = 1}, step = s->has_seen ? step_from(p, s->seen_ticks, s->seen_counter, s->seen_at, &at) : none;
    const int has_state = p->state >= 0 && slots_of(s)[p->state].here;
    if (p->is_answered && s->expects_state && !has_state && !step.goes_on) {
        s->result.age = s->result.uncertainty = NAN;
        s->goes_on = 0;
        return SB_OLD | SB_JUMP; /* strains of another time whose session is not stated */
    }
    s->unseen += s->has_seen && step.goes_on ? step.unseen : LONGEST_DELAY;
    uint32_t causes;
    if (p->synchronised >= 0.0) {
        causes = date_by_system_time(p, s, &at);
    } else if (p->is_answered && s->expects_state && (echo->is_named || !p->accepts)) {
        causes = date_by_echo(p, s, &at, &step, echo);
    } else {
        causes = date_by_anchor(p, s, &at, &step);
    }
    s->step_time = step.time;
    s->goes_on = s->has_seen && step.goes_on;
    s->step_count = s->has_seen && step.time > 0.0 ? step.steps : 0; /* a sender of another period goes on nowhere */
    s->seen_ticks = ticks;
    s->seen_counter = counter;
    s->seen_at = s->first;
    s->has_seen = 1;
    return causes;
}

/* The delay of a frame beyond the smallest one, by its own clock; 0 if it is too large. Three in a row are a restart. */
int clock_delay(const SbPlan *p, SbClock *clock, const SbSlot *slot, int64_t ticks, double time, double *delay) {
    const Sample at = {ticks, -1, p->signal[slot->sample_time].length, slot->tick, time, time};
    SbClock k = widened(p, clock, &at);
    const double arrived = time - k.source;
    if (!clock->is_set || arrived < k.upper) {
        k.upper = arrived;
    }
    *delay = arrived - k.upper;
    if (clock->is_set && *delay > slot->hold && ++clock->n_odd < p->late_limit) {
        return 0;
    }
    if (*delay > slot->hold) {
        k.upper = arrived;
        *delay = 0.0;
    }
    k.is_set = 1;
    k.n_odd = 0;
    *clock = k;
    return 1;
}
