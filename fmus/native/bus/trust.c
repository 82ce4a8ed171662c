/* The rule of trust: an ordered table. The first row that applies gives the quality of a result, and `usable` is a column
   of it. Quality and `usable` come from here and from nowhere else. */

#include "bus.h"

static const uint32_t TOO_OLD = SB_OLD | SB_FROZEN | SB_SILENT;
static const uint32_t NOT_PROVEN = SB_AGE_UNKNOWN | SB_RESTART | SB_SECOND_SENDER | SB_SECOND_BRIDGE | SB_PERIOD;
static const uint32_t LEFT_OUT = SB_PARTIAL | SB_GAUGE | SB_NOT_TRUSTED | SB_STATUS | SB_OVERLOAD | SB_BUS | SB_PRESSURE;

/* Whether loads may be used with their standard deviations, by quality. */
static const uint8_t USABLE[] = {[SB_NO_DATA] = 0,  [SB_VALID] = 1, [SB_UNPROTECTED] = 1, [SB_DEGRADED] = 1,
                                 [SB_SUSPECT] = 0, [SB_STALE] = 0, [SB_INVALID] = 0,     [SB_UNCONFIRMED] = 0};

static int is_without_loads(int health) {
    return health == HEALTH_NO_COEFFICIENTS || health == HEALTH_INVALID || health == HEALTH_UNIDENTIFIED;
}

int sb_quality(uint32_t causes, int is_long, int ever, int n_used, int is_estimated, int health, int is_protected) {
    const int has_none = n_used == 0;
    const struct {
        int quality, applies;
    } row[] = {
        {SB_NO_DATA, has_none && !ever},
        {SB_STALE, has_none && causes & TOO_OLD && !is_long},
        {SB_INVALID, has_none || !is_estimated || is_without_loads(health)},
        {SB_UNCONFIRMED, (causes & NOT_PROVEN) != 0},
        {SB_SUSPECT, health != HEALTH_OK && health != HEALTH_DEGRADED}, /* an unknown state is never better */
        {SB_DEGRADED, health == HEALTH_DEGRADED || causes & LEFT_OUT},
        {SB_UNPROTECTED, !is_protected},
    };
    for (size_t k = 0; k < sizeof row / sizeof *row; k++) {
        if (row[k].applies) {
            return row[k].quality;
        }
    }
    return SB_VALID;
}

int sb_usable(int quality, int health) {
    return quality >= 0 && quality <= SB_UNCONFIRMED && USABLE[quality] &&
           (health == HEALTH_OK || health == HEALTH_DEGRADED);
}

int has_coefficients(int quality) {
    return quality != SB_NO_DATA && quality != SB_STALE && quality != SB_INVALID;
}

/* Take a token for a result without loads: a babbling input gets no babbling answer. */
static int may_refuse(const SbPlan *p, SbState *s, double now) {
    static const double AT_ONCE = 20.0, PER_CYCLE = 2.0;
    const double since = now > s->refilled ? now - s->refilled : 0.0;
    s->refilled = now;
    s->refusals += since / p->cycle * PER_CYCLE;
    s->refusals = s->refusals < AT_ONCE ? s->refusals : AT_ONCE;
    if (s->refusals < 1.0) {
        return 0;
    }
    s->refusals -= 1.0;
    return 1;
}

int sb_answer(const SbPlan *p, SbState *s, const double *now, int health, int is_estimated) {
    SbResult *r = &s->result;
    const double ready = r->time; /* what is heard of it is heard later; and a replay knows no other time */
    if (*now > r->time) {
        r->age += *now - r->time;
        r->time = *now;
    }
    if (r->n_used && r->age - r->held > p->max_age) { /* the bridge stood still */
        r->n_used = 0;
        r->causes |= SB_OLD | SB_OVERLOAD;
    } else if (r->n_used && r->age - r->held + r->uncertainty > p->max_age) {
        r->causes |= SB_AGE_UNKNOWN;
    }
    r->causes |= health > HEALTH_OK ? SB_HEALTH : 0;
    r->causes |= r->n_used && health < 0 ? SB_STEP_FAILED : 0;
    r->causes |= health >= 0 && !is_estimated && health <= HEALTH_INCONSISTENT ? SB_STEP_FAILED : 0;
    const int is_long = r->is_silent && r->time - s->last_cycle > p->invalid_after;
    r->quality = sb_quality(r->causes, is_long, s->ever, r->n_used, is_estimated, health, p->is_protected);
    r->usable = sb_usable(r->quality, health);
    s->ever |= r->n_used && health >= 0 && is_estimated && !is_without_loads(health);
    if (!has_coefficients(r->quality) && !r->is_silent && !may_refuse(p, s, r->time)) {
        s->noted |= r->causes & (SB_OVERLOAD | SB_BUS); /* what degrades the next result, too */
        return 0;
    }
    const int32_t counter = (p->first_result + s->n_results) % p->n_counters;
    s->n_results = (s->n_results + 1) % p->n_counters;
    if (r->sample_time >= 0) {
        s->answer[s->n_answers] = (SbAnswer){.ticks = r->sample_time, .counter = counter, .cycle = r->counter, .ready = ready,
                                             .unseen = s->unseen};
        s->n_answers = (s->n_answers + 1) % SB_ANSWERS;
    }
    return 1;
}
