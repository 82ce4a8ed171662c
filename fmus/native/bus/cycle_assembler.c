#include <math.h>
#include <string.h>

#include "strainbus.h"

/* What a frame is by its sample time: of its own time if that is ahead by less than half of the range, of the newest
   cycle, or an old one. */
static int64_t in_time(SbAssembler *a, int slot, const int64_t *number) {
    if (!a->has_newest) {
        return SB_IN_CYCLE;
    }
    const uint64_t half = UINT64_C(1) << (a->bits - 1), all = half | (half - 1);
    const uint64_t ahead = ((uint64_t)number[SB_NUMBER_SAMPLE_TIME] - (uint64_t)a->newest) & all;
    if (ahead > 0 && ahead < half) {
        return SB_IN_CYCLE;
    }
    if (a->open >= 0 && ahead == 0) {
        const SbParts *p = a->parts[a->open];
        if (number[SB_NUMBER_COUNTER] == p->number[p->order[0] * SB_N_NUMBERS + SB_NUMBER_COUNTER]) {
            return p->here[slot] ? SB_TWICE : SB_IN_CYCLE;
        }
    }
    a->late++;
    return a->late <= a->late_limit ? SB_LATE : SB_RESTARTED_CYCLES;
}

/* Begin a cycle in the parts that no cycle uses which has just been closed. */
static void begin(SbAssembler *a, int64_t closed, const int64_t *number, double time) {
    a->open = closed == 0 ? 1 : 0;
    SbParts *p = a->parts[a->open];
    memset(p->data, 0, (size_t)a->start[a->n_slots]);
    memset(p->here, 0, (size_t)a->n_slots);
    p->n = 0;
    p->first_time = p->last_time = time;
    a->deadline = time + a->wait;
    a->newest = number[SB_NUMBER_SAMPLE_TIME];
    a->has_newest = 1;
}

static void put(SbParts *p, int slot, const uint8_t *data, const int64_t *number, double time, const int64_t *start) {
    if (!p->here[slot]) {
        p->here[slot] = 1;
        p->order[p->n++] = slot;
    }
    p->last_time = time > p->last_time ? time : p->last_time;
    p->time[slot] = time;
    memcpy(p->data + start[slot], data, (size_t)(start[slot + 1] - start[slot]));
    memcpy(p->number + slot * SB_N_NUMBERS, number, SB_N_NUMBERS * sizeof *number);
}

int64_t sb_close(SbAssembler *assembler) {
    const int64_t open = assembler->open;
    assembler->open = -1;
    assembler->deadline = INFINITY;
    return open;
}

int64_t sb_offer(SbAssembler *assembler, int slot, const uint8_t *data, const int64_t *number, const double *time) {
    SbAssembler *a = assembler;
    int64_t verdict = SB_IN_CYCLE, n_closed = 0, is_next;
    if (a->is_timed) {
        verdict = in_time(a, slot, number);
        if (verdict == SB_LATE || verdict == SB_TWICE) {
            return verdict;
        }
        is_next = verdict == SB_RESTARTED_CYCLES || !a->has_newest || number[SB_NUMBER_SAMPLE_TIME] != a->newest;
    } else {
        is_next = a->open >= 0 && a->parts[a->open]->here[slot];
    }
    if (is_next && a->open >= 0) {
        a->closed[n_closed++] = sb_close(a);
    }
    a->late = 0;
    if (a->open < 0) {
        begin(a, n_closed > 0 ? a->closed[0] : -1, number, *time);
    }
    SbParts *p = a->parts[a->open];
    put(p, slot, data, number, *time, a->start);
    if (p->n == a->n_whole || slot == a->trailer) {
        a->closed[n_closed++] = sb_close(a);
    }
    return verdict | n_closed * SB_CLOSED;
}
