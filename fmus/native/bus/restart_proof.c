#include "restart_proof.h"

#include <math.h>

#include "rounding.h"
#include "sender_clock.h"

/* Whether the clock began after the sender was last heard, and the counter no earlier. */
static int has_begun(const SbProof *p, double seconds, int64_t counter) {
    const double largest = seconds / p->period + (double)p->max_delta;
    return p->begins && (p->modulus == 0 || counter < 0 || (double)counter <= largest || largest >= (double)p->modulus);
}

/* Whether the time went ahead while the counter continued at its pace. */
static int was_set_ahead(const SbProof *p, const SbClock *clock, double local, int64_t ticks, int64_t counter) {
    if (!p->has_last || clock_seconds_ahead(clock, local, ticks) <= 0.0) {
        return 0;
    }
    if (p->modulus == 0 || counter < 0 || p->last_counter < 0) {
        return 1;
    }
    const int64_t half = p->modulus / 2;
    const int64_t error = counter - p->last_counter - whole_number((local - p->last_local) / p->period);
    const int64_t rest = ((error + half) % p->modulus + p->modulus) % p->modulus - half;
    return (rest < 0 ? -rest : rest) <= p->max_delta;
}

static void keep(SbProof *p, double local, int64_t counter) {
    p->has_last = 1;
    p->last_local = local;
    p->last_counter = counter;
}

int proof_take(SbProof *p, const SbClock *clock, int64_t reading, double local, int64_t ticks, int64_t counter,
               int is_new) {
    const int jumped = (reading & SB_JUMPED) != 0;
    if (!jumped && (p->is_proven || reading & SB_RESUMED)) {
        p->is_proven = 1;
        p->n_new = p->begins = 0;
        keep(p, local, counter);
        return 0;
    }
    const double seconds = (double)ticks * clock->tick;
    p->n_new = is_new || p->accepts ? p->n_new + 1 : 0;
    if (jumped) {
        const double silence = p->has_last ? local - p->last_local : 0.0;
        p->begins = seconds <= p->startup_time + silence;
    }
    if (jumped && !(reading & SB_RESTARTED)) {
        return 0;
    }
    p->has_begun = has_begun(p, seconds, counter);
    p->is_proven = p->n_new >= p->new_frames &&
                   (p->accepts || p->has_begun || was_set_ahead(p, clock, local, ticks, counter));
    if (p->is_proven) {
        keep(p, local, counter);
    }
    return p->is_proven != 0;
}

int proof_begins_again(SbProof *p, const SbClock *clock, double local, int64_t ticks, int64_t counter) {
    if (!p->accepts || !p->has_last || local - p->last_local <= p->pause) {
        return 0;
    }
    const double seconds = (double)ticks * clock->tick;
    p->begins = seconds <= p->startup_time;
    if (!has_begun(p, seconds, counter)) {
        return 0;
    }
    p->is_proven = p->n_new = 0;
    return 1;
}

void proof_take_untimed(SbProof *p, double local, int is_new) {
    if (local - p->heard > p->pause) { /* no if it was never heard */
        p->is_proven = p->n_new = 0;
    }
    p->heard = local;
    p->n_new = is_new || p->accepts ? p->n_new + 1 : 0;
    p->is_proven = p->is_proven || p->n_new >= p->new_frames;
}

void sb_strain_time(const SbStrainTime *strain_time, const double *now, double *found) {
    const SbStrainTime *s = strain_time;
    *found = s->proof != NULL && !s->proof->is_proven ? NAN : s->seconds + *now - s->local;
}
