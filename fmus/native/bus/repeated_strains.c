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

/* The gauges of a frame, or of all: those that come in every cycle. Frames that are held repeat their readings. */
typedef struct {
    const int64_t *gauge;
    int64_t n;
    int has_slow;
} Group;

static Group group_of(const SbChecks *c, int64_t k) {
    const SbWatch *w = c->watch;
    Group g = {.gauge = w->order + w->group_first[k], .n = w->group_first[k + 1] - w->group_first[k]};
    for (int64_t i = 0; i < c->n; i++) {
        g.has_slow |= c->is_fast[i];
    }
    return g;
}

static int is_complete(const Group *g, const SbCycle *cycle) {
    for (int64_t k = 0; k < g->n; k++) {
        if (!cycle->present[g->gauge[k]]) {
            return 0;
        }
    }
    return 1;
}

/* Hash of the readings of a group, never 0. */
static uint64_t hash_of(const SbChecks *c, const Group *g, int64_t number, const SbCycle *cycle) {
    uint64_t hash = mixed((uint64_t)number);
    for (int64_t k = 0; k < g->n; k++) {
        const int64_t i = g->gauge[k];
        if (!g->has_slow || c->is_fast[i]) {
            hash = mixed(hash ^ (uint64_t)cycle->raw[i]);
        }
    }
    return hash == 0 ? 1 : hash;
}

/* Logarithm of the largest probability with which two cycles have the same readings of a group's plausible gauges. */
static double log_probability(const SbChecks *c, const Group *g, const SbCycle *cycle, const uint8_t *plausible) {
    const SbWatch *w = c->watch;
    double sum = 0.0;
    for (int64_t k = 0; k < g->n; k++) {
        const int64_t i = g->gauge[k];
        if (plausible[i] && (!g->has_slow || c->is_fast[i])) {
            const double *table = fabs(cycle->strain[i]) < 0.5 * w->step[i] ? w->log_repeated_zero : w->log_repeated;
            sum += table[w->row[i] * (SB_LONGEST_RUN + 1) + 1];
        }
    }
    return sum;
}

static void remember(SbRepeats *r, uint64_t hash) {
    uint64_t *place = &r->hash[hash % SB_REPEATS_PLACES];
    if (*place != hash) {
        *place = hash;
        r->n += r->n < SB_REPEATS_PLACES;
    }
}

int repeats_take(SbRepeats *repeats, const SbChecks *c, const SbCycle *cycle, const uint8_t *plausible) {
    SbRepeats *r = repeats;
    const double of_count = logarithm((double)(r->n > 0 ? r->n : 1));
    r->counts -= r->counts > 0;
    for (int64_t k = 0; k < r->n_groups; k++) {
        const Group g = group_of(c, k);
        if (!r->is_kept[k] || !is_complete(&g, cycle)) {
            continue;
        }
        const uint64_t hash = hash_of(c, &g, k, cycle);
        const int is_known = r->hash[hash % SB_REPEATS_PLACES] == hash && hash != r->last[k];
        r->last[k] = hash;
        if (is_known && log_probability(c, &g, cycle, plausible) + of_count < r->limit) {
            r->counts = r->alarm; /* of a buffer, some cycles may never have come */
        }
        remember(r, hash);
    }
    return r->counts > 0;
}

void sb_repeats_remember(SbRepeats *repeats, const SbChecks *checks, const SbCycle *cycle) {
    for (int64_t k = 0; k < repeats->n_groups; k++) {
        const Group g = group_of(checks, k);
        if (repeats->is_kept[k] && is_complete(&g, cycle)) {
            remember(repeats, hash_of(checks, &g, k, cycle));
        }
    }
}

void sb_repeats_forget(SbRepeats *repeats) {
    memset(repeats->hash, 0, SB_REPEATS_PLACES * sizeof *repeats->hash);
    memset(repeats->last, 0, (size_t)repeats->n_groups * sizeof *repeats->last);
    repeats->n = repeats->counts = 0;
}
