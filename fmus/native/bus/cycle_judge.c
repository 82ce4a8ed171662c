#include <math.h>
#include <string.h>

#include "repeated_strains.h"
#include "restart_proof.h"
#include "seen_frames.h"
#include "sender_clock.h"

static const int64_t *number_of(const SbParts *p, int64_t slot) {
    return p->number + slot * SB_N_NUMBERS;
}

static int is_readable(const SbJudge *j) {
    return j->found[SB_FOUND_REFUSED] == SB_REFUSED_NOT || j->found[SB_FOUND_REFUSED] == SB_REFUSED_UNTRUSTED;
}

/* --- frames ------------------------------------------------------------------------------------------------------ */

/* Note which frames of strains are missing: 1 if any is. The state of those that need not come is left as it is. */
static int miss(const SbJudge *j, const SbParts *p) {
    int any = 0;
    for (int64_t slot = 0; slot < j->n_strain; slot++) {
        if (!p->here[slot]) {
            any = 1;
            if (!j->is_held[slot]) {
                sb_machine_add(j->slot[slot]->machine, SB_NO_NEW_DATA);
            }
        }
    }
    return any;
}

static int is_complete(const SbJudge *j, const SbParts *p) {
    for (int64_t slot = 0; slot < j->n_strain; slot++) {
        if (!p->here[slot]) {
            return 0;
        }
    }
    return 1;
}

/* Check CRC and counter over a cycle. */
static void check_trailer(SbJudge *j, const SbParts *p, int64_t trailer) {
    static const int64_t refused[] = {
        [SB_OK] = SB_REFUSED_NOT,           [SB_SOME_LOST] = SB_REFUSED_NOT,
        [SB_REPEATED] = SB_REFUSED_REPEATED, [SB_WRONG_SEQUENCE] = SB_REFUSED_SEQUENCE,
        [SB_ERROR] = SB_REFUSED_UNVERIFIED,
    };
    SbSlot *slot = j->slot[trailer];
    if (!p->here[trailer] || slot->check == NULL || !is_complete(j, p)) {
        sb_machine_add(slot->machine, SB_NO_NEW_DATA);
        j->found[SB_FOUND_REFUSED] = SB_REFUSED_UNVERIFIED;
        j->found[SB_FOUND_CAUSES] |= SB_CYCLE_CRC | SB_PARTIAL_CYCLE;
        return;
    }
    const int64_t *start = j->assembler->start;
    const int length = (int)(start[trailer + 1] - start[trailer]);
    const int64_t status = sb_check(slot->check, &p->time[trailer], p->data + start[trailer], length, p->data,
                                    (int)start[j->n_strain]);
    sb_machine_add(slot->machine, (int)status);
    j->trailer_status = (uint64_t)number_of(p, trailer)[SB_NUMBER_STATUS];
    j->found[SB_FOUND_CHECKED] = 1;
    j->found[SB_FOUND_REFUSED] = refused[status];
    if (refused[status] != SB_REFUSED_NOT) {
        j->found[SB_FOUND_CAUSES] |= SB_CYCLE_CRC;
    } else if (slot->trusted_by->state != SB_VALID) {
        j->found[SB_FOUND_REFUSED] = SB_REFUSED_UNTRUSTED;
        j->found[SB_FOUND_CAUSES] |= SB_CAUSE_NOT_TRUSTED;
    }
}

void sb_judge_verify(SbJudge *judge, const SbParts *parts) {
    SbJudge *j = judge;
    const int64_t trailer = j->assembler->trailer;
    memset(j->found, 0, SB_N_FOUND * sizeof *j->found);
    j->trailer_status = 0;
    j->found[SB_FOUND_CAUSES] = miss(j, parts) ? SB_PARTIAL_CYCLE : 0;
    j->found[SB_FOUND_NAMED] = trailer >= 0 && parts->here[trailer] ? trailer : parts->order[0];
    const int64_t *number = number_of(parts, j->found[SB_FOUND_NAMED]);
    j->found[SB_FOUND_SAMPLE_TIME] = number[SB_NUMBER_SAMPLE_TIME];
    j->found[SB_FOUND_COUNTER] = number[SB_NUMBER_COUNTER];
    if (trailer >= 0) {
        check_trailer(j, parts, trailer);
    }
}

void sb_judge_decode(SbJudge *judge, const SbParts *parts) {
    SbJudge *j = judge;
    const int readable = is_readable(j); /* strains whose CRC fits are read even while they are not trusted yet */
    uint64_t worst = j->trailer_status;
    for (int64_t slot = 0; readable && slot < j->n_strain; slot++) {
        const uint64_t status = parts->here[slot] ? (uint64_t)number_of(parts, slot)[SB_NUMBER_STATUS] : 0;
        worst = status > worst ? status : worst;
    }
    j->found[SB_FOUND_STATUS] = (int64_t)worst;
    sb_decode(j->decoder, readable ? parts->data : j->nothing, readable ? parts->here : j->nothing,
              worst > (uint64_t)j->worst_status, j->cycle);
}

/* --- time ----------------------------------------------------------------------------------------------------------- */

/* What shows where the clock of a restarted sender stands: that it began behind the last strains, or the counter. */
static int evidence_of(const SbJudge *j, const SbParts *p) {
    if (j->proof != NULL) {
        return j->proof->has_begun ? CLOCK_BEGAN : CLOCK_COUNTER_CONTINUES;
    }
    const SbModel *old = &j->clock->before;
    return j->clock->known.source <= p->first_time * j->clock->pace - old->local ? CLOCK_BEGAN : CLOCK_CONTINUES;
}

/* Date a cycle by its sample time; 1 if its sender has been proven with it. */
static int date(SbJudge *j, const SbParts *p, int is_new) {
    const int64_t ticks = j->found[SB_FOUND_SAMPLE_TIME];
    const SbModel known = j->clock->known;
    const int64_t reading = clock_read(j->clock, p->first_time, ticks, j->found[SB_FOUND_COUNTER]);
    if (j->proof != NULL && j->clock->age > j->max_age &&
        proof_begins_again(j->proof, j->clock, p->first_time, ticks, j->found[SB_FOUND_COUNTER])) {
        clock_begin(j->clock, &known, p->first_time, ticks);
        j->found[SB_FOUND_CAUSES] |= SB_CLOCK_JUMP;
        return 0;
    }
    j->age[0] += j->clock->age;
    j->age[1] = j->clock->uncertainty;
    if (reading & SB_JUMPED) {
        j->found[SB_FOUND_CAUSES] |= SB_CLOCK_JUMP;
    }
    if (reading & SB_RESTARTED) {
        for (int64_t slot = 0; slot < j->assembler->n_slots; slot++) {
            sb_machine_reset(j->slot[slot]->machine);
        }
    }
    if (reading & SB_HIDES_DELAY || j->age[1] > j->max_uncertainty) {
        j->found[SB_FOUND_CAUSES] |= SB_HIDDEN_DELAY;
    }
    if (!(reading & SB_JUMPED) || reading & SB_RESTARTED) {
        j->strain_time->local = p->first_time;
        j->strain_time->seconds = (double)ticks * j->clock->tick;
    }
    clock_note_new(j->clock, reading, j->found[SB_FOUND_COUNTER], is_new);
    const int was_proven = j->proof != NULL && j->proof->is_proven;
    const int is_proven =
        j->proof == NULL ? (reading & SB_RESTARTED) != 0
                         : proof_take(j->proof, j->clock, reading, p->first_time, ticks, j->found[SB_FOUND_COUNTER], is_new);
    if (!(j->proof != NULL && j->proof->accepts) && (reading & SB_RESTARTED || (is_proven && !was_proven))) {
        if (is_proven) {
            const double age = j->clock->age;
            clock_leave_repeated(j->clock, j->found[SB_FOUND_COUNTER]);
            j->age[0] += j->clock->age - age;
        }
        clock_bound_restart(j->clock, evidence_of(j, p), j->found[SB_FOUND_COUNTER]);
        j->age[1] = j->clock->uncertainty + j->clock->known.doubt;
    }
    return is_proven;
}

/* Whether any gauge differs from a cycle that came just before and was passed over. */
static int has_changed_since_passed(const SbJudge *j, const SbParts *p) {
    if (!j->has_passed || p->first_time - j->passed_time > 1.5 * j->period) {
        return 0;
    }
    for (int64_t i = 0; i < j->decoder->n; i++) {
        if (j->passed->present[i] && j->cycle->present[i] && j->passed->raw[i] != j->cycle->raw[i]) {
            return 1;
        }
    }
    return 0;
}

/* Strains that the sender repeats have the age of their first occurrence, and the time since; the clock shows no more about
   them. Where the readings of quiet gauges may repeat themselves so often by chance, what makes them too old is doubt
   instead. `is_dated`: the clock has shown an age. */
static void add_frozen(SbJudge *j, const SbParts *p, int is_dated) {
    const double frozen = j->checks->frozen_for[0], unheard = j->checks->frozen_for[1];
    if (!(frozen > 0.0)) {
        if (is_readable(j)) { /* a cycle that is not read shows no change */
            j->changed_age = is_dated ? j->clock->age : NAN;
            j->changed_doubt = j->age[1];
        }
    } else if (is_dated && !isnan(j->changed_age)) {
        j->age[0] += j->changed_age - j->clock->age;
        j->age[1] = j->changed_doubt > j->age[1] ? j->changed_doubt : j->age[1];
    }
    j->age[1] += j->checks->frozen_for[2]; /* NaN stays NaN */
    const double room = j->max_age - j->age[0];
    if (j->checks->may_be_chance && frozen > room && room > 0.0) {
        j->age[0] = j->max_age;
        j->age[1] = (isnan(j->age[1]) ? 0.0 : j->age[1]) + (frozen - room);
        j->found[SB_FOUND_CAUSES] |= j->age[1] > j->max_uncertainty ? SB_HIDDEN_DELAY : 0;
    } else {
        j->age[0] += frozen;
    }
    if (frozen > 0.0 && !j->checks->may_be_chance && j->age[0] > j->max_age) {
        j->found[SB_FOUND_CAUSES] |= SB_CAUSE_FROZEN;
    }
    if (unheard > 0.0 && !has_changed_since_passed(j, p)) {
        /* They may have been frozen in the cycles that were lost: the next ones will show it. */
        j->age[1] = isnan(j->age[1]) ? unheard : j->age[1] + unheard;
        if (unheard > j->hidden_age * (1.0 + 1e-9)) {
            j->found[SB_FOUND_CAUSES] |= SB_HIDDEN_DELAY;
        }
    }
}

static void find_age(SbJudge *j, const SbParts *p, double now) {
    const int together = j->assembler->trailer >= 0, readable = is_readable(j);
    const int is_new = readable && seen_add_frames(j->seen, j->assembler, p, together);
    const int is_timed = j->slot[j->found[SB_FOUND_NAMED]]->place[SB_NUMBER_SAMPLE_TIME] >= 0;
    j->age[0] = now - p->first_time;
    j->age[1] = NAN;
    const int has_date = j->clock != NULL && readable && is_timed;
    if (has_date) {
        if (date(j, p, is_new)) {
            j->clock->before.is_set = 0;
            /* The clock of q_inf may be so short that a restart looks like a delay. */
            sb_flow_reset(j->value, (int)j->n_values);
        }
    } else if (j->clock == NULL && j->proof != NULL && readable) {
        proof_take_untimed(j->proof, p->first_time, is_new);
    }
    /* Late strains for long, without a pause: a gateway that never catches up, or a restart whose clock looks late. */
    j->n_late = j->clock != NULL && j->clock->age > j->max_age && !j->clock->is_synchronised ? j->n_late + 1 : 0;
    if ((j->proof != NULL && !j->proof->is_proven) || j->n_late > j->longest_late) {
        j->found[SB_FOUND_CAUSES] |= SB_UNPROVEN_RESTART;
    }
    if (j->age[0] > j->max_age || (j->clock == NULL && j->may_be_held_back)) {
        j->found[SB_FOUND_CAUSES] |= SB_OLD;
    }
    if (j->checks->looks_for_frozen) {
        add_frozen(j, p, has_date && !(j->found[SB_FOUND_CAUSES] & SB_CLOCK_JUMP));
    }
    if (j->repeats != NULL && readable && repeats_take(j->repeats, j->checks, j->cycle, j->plausible)) {
        j->found[SB_FOUND_CAUSES] |= SB_CAUSE_REPEATS;
    } else if (j->repeats != NULL && !readable && j->found[SB_FOUND_REFUSED] != SB_REFUSED_UNVERIFIED) {
        sb_decode(j->decoder, p->data, p->here, 0, j->passed);
        sb_repeats_remember(j->repeats, j->checks, j->passed);
    }
    j->has_passed = 0;
}

/* --- gauges and flow ------------------------------------------------------------------------------------------------ */

static void find_valid(SbJudge *j, const SbParts *p) {
    const int is_used = j->found[SB_FOUND_REFUSED] == SB_REFUSED_NOT;
    int64_t n_valid = 0, causes = 0;
    for (int64_t i = 0; i < j->decoder->n; i++) {
        const int64_t slot = j->decoder->frame[i];
        const int trusted = p->here[slot] && j->slot[slot]->trusted_by->state == SB_VALID;
        const int plausible = j->plausible[i] != 0, valid = is_used && trusted && plausible;
        causes |= j->cycle->present[i] && !trusted ? SB_CAUSE_NOT_TRUSTED : 0;
        causes |= j->cycle->present[i] && !plausible ? SB_GAUGE_INVALID : 0;
        j->trusted[i] = (uint8_t)trusted;
        j->valid[i] = (uint8_t)valid;
        j->strain[i] = valid ? j->cycle->strain[i] : NAN;
        n_valid += valid;
    }
    j->found[SB_FOUND_CAUSES] |= causes;
    j->found[SB_FOUND_N_VALID] = n_valid;
}

static void find_flow(SbJudge *j, double now) {
    const int64_t flags = sb_flow_known(j->value, (int)j->n_values, &now, j->known);
    j->found[SB_FOUND_LOST] = (flags & SB_LOST) != 0;
    if (j->is_fixed) {
        return;
    }
    if (j->pressure >= 0 && isnan(j->known[j->pressure])) {
        j->found[SB_FOUND_CAUSES] |= SB_DYNAMIC_PRESSURE;
    }
    if (flags & SB_DELAY_HIDDEN) {
        j->found[SB_FOUND_CAUSES] |= SB_HIDDEN_DELAY;
    }
}

void sb_judge_go_on(SbJudge *judge, const SbParts *parts, const double *now) {
    SbJudge *j = judge;
    const int64_t of_frames = j->found[SB_FOUND_CAUSES];
    j->found[SB_FOUND_CAUSES] = 0;
    find_age(j, parts, *now);
    if (j->found[SB_FOUND_REFUSED] == SB_REFUSED_NOT && j->found[SB_FOUND_CAUSES] & j->unusable) {
        j->found[SB_FOUND_REFUSED] = SB_REFUSED_OLD;
    }
    j->found[SB_FOUND_CAUSES] |= of_frames | (j->found[SB_FOUND_STATUS] != 0 ? SB_SENDER_STATUS : 0) |
                                 (j->has_frozen ? SB_CAUSE_FROZEN : 0);
    find_valid(j, parts);
    find_flow(j, *now);
}

/* --- all at once ---------------------------------------------------------------------------------------------------- */

/* Go on when the gauges have been checked, with these flags. */
static int64_t checked(SbJudge *j, const SbParts *p, int64_t flags, const double *now) {
    sb_checks_frozen(j->checks, j->cycle, &p->first_time);
    j->has_frozen = (flags & SB_HAS_FROZEN) != 0;
    memcpy(j->plausible, j->checks->valid, (size_t)j->decoder->n);
    if (flags & SB_ALL_ZERO) {
        return SB_TO_SEE_ZERO;
    }
    sb_judge_go_on(j, p, now);
    return SB_JUDGED;
}

int64_t sb_judge_cycle(SbJudge *judge, const SbParts *parts, const double *now) {
    sb_judge_verify(judge, parts);
    sb_judge_decode(judge, parts);
    const int64_t flags = sb_checks_update(judge->checks, judge->cycle, &parts->first_time);
    return flags == SB_LEARNED ? SB_TO_LEARN : checked(judge, parts, flags, now);
}

int64_t sb_judge_learned(SbJudge *judge, const SbParts *parts, const double *now) {
    return checked(judge, parts, sb_checks_end(judge->checks, judge->cycle, &parts->first_time), now);
}

int64_t sb_judge_pass_over(SbJudge *judge, const SbParts *parts) {
    SbJudge *j = judge;
    sb_judge_verify(j, parts);
    seen_add_frames(j->seen, j->assembler, parts, j->assembler->trailer >= 0);
    j->has_passed = j->found[SB_FOUND_REFUSED] == SB_REFUSED_NOT;
    if (j->has_passed) {
        j->passed_time = parts->first_time;
        sb_decode(j->decoder, parts->data, parts->here, 0, j->passed);
        if (j->repeats != NULL) {
            sb_repeats_remember(j->repeats, j->checks, j->passed);
        }
    }
    return j->found[SB_FOUND_REFUSED];
}
