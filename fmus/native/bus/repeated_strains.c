#include "repeated_strains.h"

#include <math.h>
#include <string.h>

#include "../core/elementary.h"

/* A step of splitmix64 (S. Vigna), which mixes all bits of a number. */
static uint64_t mixed(uint64_t x) {
    x += UINT64_C(0x9E3779B97F4A7C15);
    x = (x ^ x >> 30) * UINT64_C(0xBF58476D1CE4E5B9);
    x = (x ^ x >> 27) * UINT64_C(0x94D049BB133111EB);
    return x ^ x >> 31;
}

/* Hash of all readings, never 0. Frames that are held repeat their readings: only gauges of every cycle count. */
static uint64_t hash_of(const SbChecks *c, const SbCycle *cycle, int has_slow) {
    uint64_t hash = 0;
    for (int64_t i = 0; i < c->n; i++) {
        if (!has_slow || c->is_fast[i]) {
            hash = mixed(hash ^ (uint64_t)cycle->raw[i]);
        }
    }
    return hash == 0 ? 1 : hash;
}

/* Logarithm of the largest probability with which two cycles have the same readings. */
static double log_probability(const SbChecks *c, const SbCycle *cycle, const uint8_t *plausible, int has_slow) {
    const SbWatch *w = c->watch;
    double sum = 0.0;
    for (int64_t i = 0; i < c->n; i++) {
        if (plausible[i] && (!has_slow || c->is_fast[i])) {
            const double *table = fabs(cycle->strain[i]) < 0.5 * w->step[i] ? w->log_repeated_zero : w->log_repeated;
            sum += table[w->row[i] * (SB_LONGEST_RUN + 1) + 1];
        }
    }
    return sum;
}

int repeats_take(SbRepeats *repeats, const SbChecks *c, const SbCycle *cycle, const uint8_t *plausible) {
    SbRepeats *r = repeats;
    int has_slow = 0;
    for (int64_t i = 0; i < c->n; i++) {
        if (!cycle->present[i]) {
            return r->counts > 0;
        }
        has_slow |= c->is_fast[i];
    }
    const uint64_t hash = hash_of(c, cycle, has_slow);
    uint64_t *place = &r->hash[hash % SB_REPEATS_PLACES];
    const int is_known = *place == hash && hash != r->last;
    r->last = hash;
    r->counts -= r->counts > 0;
    const double of_count = logarithm((double)(r->n > 0 ? r->n : 1));
    if (is_known && log_probability(c, cycle, plausible, has_slow) + of_count < r->limit) {
        r->counts = r->alarm; /* of a buffer, some cycles may never have come */
    }
    if (*place != hash) {
        *place = hash;
        r->n += r->n < SB_REPEATS_PLACES;
    }
    return r->counts > 0;
}

void sb_repeats_forget(SbRepeats *repeats) {
    memset(repeats->hash, 0, SB_REPEATS_PLACES * sizeof *repeats->hash);
    repeats->n = repeats->counts = 0;
    repeats->last = 0;
}
