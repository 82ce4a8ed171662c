#include <math.h>

#include "rounding.h"
#include "seen_frames.h"
#include "sender_clock.h"
#include "signals.h"

/* Whether a sample time is the strains' time, as far as the clock's range shows. */
static int agrees(const SbValue *v, int64_t ticks, double strain_time) {
    const double half = 0.5 * v->clock->range, ahead = (double)ticks * v->clock->tick - strain_time;
    return fabs(remainder_of(ahead + half, v->clock->range) - half) <= v->tolerance; /* no if it is not known */
}

/* Date a value by its sample time: 1 and its delay [s]; 0 if its sender is not proven, or its time has jumped. A frame
   behind a restart is no recording if it is new, or at the time of the strains. */
static int is_proven(SbValue *v, int64_t ticks, const double *time, int is_new, double *delay) {
    const int64_t reading = clock_read(v->clock, time[0], ticks, -1);
    v->n_new = is_new ? v->n_new + 1 : 0;
    v->to_be_proven = (v->to_be_proven || reading & SB_RESTARTED) && !(reading & SB_RESUMED);
    if (reading & SB_JUMPED) {
        return 0; /* a repeated old frame or a restart: the next frames decide */
    }
    const int at_strains = agrees(v, ticks, time[1]);
    if (v->to_be_proven && !at_strains && v->new_frames > 0 && (v->shares_clock || v->n_new < v->new_frames)) {
        return 0;
    }
    if (v->to_be_proven) {
        v->to_be_proven = v->clock->before.is_set = 0;
    }
    v->shares_clock = isnan(time[1]) ? v->shares_clock : at_strains;
    v->hides_delay = (reading & SB_HIDES_DELAY) != 0;
    *delay = v->clock->age;
    return 1;
}

/* Hold a value, and what the sender states: air at rest is stated as 0, which is of no use for coefficients. */
static int64_t hold(SbValue *v, const SbDecoder *signals, int64_t raw, int is_good, double sampled) {
    const double value = signal_value(signals, v->index, raw), in_si = value * v->to_si + v->si_offset;
    const int is_stated = isfinite(value) && is_good && !signal_is_code(signals, v->index, raw);
    const int is_sensible = v->smallest <= in_si && in_si <= v->largest;
    const int is_usable = is_stated && is_sensible && !signal_is_outside(signals, v->index, raw, value);
    v->stated = is_stated ? in_si : NAN;
    v->stated_at = sampled;
    v->value = is_usable ? in_si : NAN;
    v->sampled = is_usable ? sampled : NAN;
    v->was_known |= is_usable;
    return is_usable;
}

int64_t sb_flow_take(SbFlow *flow, const uint8_t *data, const double *now) {
    const SbFlow *f = flow;
    double time[2] = {*now, NAN};
    if (f->strain_time != NULL) {
        sb_strain_time(f->strain_time, now, &time[1]);
    }
    const int is_new = (int)seen_add(f->seen, f->prefix, data, f->length);
    int is_good = 1;
    if (f->status >= 0) {
        const int64_t status = signal_raw(f->signals, f->status, data);
        is_good = status >= 0 && status <= f->worst_status; /* of 64 bits the largest come as negative numbers */
    }
    int64_t is_usable = 0;
    for (int64_t k = 0; k < f->n_values; k++) {
        SbValue *v = f->value[k];
        double delay = 0.0;
        const int is_dated = v->clock != NULL;
        if (is_dated && !is_proven(v, signal_raw(f->signals, f->sample_time, data), time, is_new, &delay)) {
            continue;
        }
        is_usable |= hold(v, f->signals, signal_raw(f->signals, v->index, data), is_good, time[0] - delay);
    }
    return is_usable;
}

int64_t sb_flow_known(SbValue *const *value, int count, const double *now, double *known) {
    int64_t flags = 0;
    for (int k = 0; k < count; k++) {
        const SbValue *v = value[k];
        known[k] = *now - v->sampled > v->max_age ? NAN : v->value;
        flags |= (v->hides_delay ? SB_DELAY_HIDDEN : 0) | (v->was_known && isnan(known[k]) ? SB_LOST : 0);
    }
    return flags;
}

void sb_flow_reset(SbValue *const *value, int count) {
    for (int k = 0; k < count; k++) {
        SbValue *v = value[k];
        v->value = v->sampled = v->stated = v->stated_at = NAN;
        v->was_known = v->n_new = 0;
        v->to_be_proven = 1;
        if (v->clock != NULL && !v->clock->is_synchronised) {
            sb_clock_reset(v->clock);
        }
    }
}
