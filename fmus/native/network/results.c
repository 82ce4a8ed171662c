/* Values of the frames of a result, of its details and of the status: what is not published, or not known, is NaN, which
   frames have a number for; what exceeds its signal is the largest one. results.h lists the values. */

#include <math.h>
#include <string.h>

#include "results.h"

#define LARGEST_UNCERTAINTY 6553.4
#define LARGEST_SCORE 25.4

int has_coefficients(int quality) {
    return quality == SB_VALID || quality == SB_UNPROTECTED || quality == SB_DEGRADED || quality == SB_SUSPECT ||
           quality == SB_UNCONFIRMED;
}

static double at_most(double value, double largest) {
    return value > largest ? largest : value;
}

void result_values(const SbResult *r, const SbEstimate *e, double *value) {
    const int published = e->loads != NULL && has_coefficients(r->quality);
    value[0] = value[1] = 0.0; /* CRC and counter are written last */
    for (int k = 0; k < N_LOADS_SENT; k++) {
        value[R_COEFFICIENTS + k] = published ? e->loads[k] : NAN;
        value[R_SIGMA + k] = published ? e->loads[N_LOADS_SENT + k] : NAN;
    }
    value[R_QUALITY] = r->quality;
    value[R_HEALTH] = e->health < 0 ? NAN : e->health;
    value[R_USABLE] = r->usable;
    value[R_SAMPLE_TIME] = r->sample_time < 0 ? NAN : (double)r->sample_time;
    value[R_CHI_SQUARE] = e->chi_square;
    value[R_AGE] = 1e3 * r->age;
    value[R_CAUSES] = (double)((r->causes & 0x7FFFu) | (r->causes >> 16 ? 0x8000u : 0u));
    value[R_GAUGES] = at_most(e->n_gauges, 255.0);
    value[R_ANSWERED] = r->counter < 0 ? 0.0 : r->counter;
    value[R_CONFIGURATION] = e->configuration;
    value[R_PRESSURE] = r->is_silent ? NAN : e->pressure;
    value[R_SCORE] = at_most(e->score, LARGEST_SCORE);
}

void detail_values(const SbResult *r, double *value) {
    value[0] = value[1] = 0.0;
    value[D_QUALITY] = r->quality;
    value[D_CAUSES] = r->causes;
    value[D_USABLE] = r->usable;
    value[D_UNCERTAINTY] = at_most(1e3 * r->uncertainty, LARGEST_UNCERTAINTY);
    value[D_ANSWERED] = r->counter < 0 ? 0.0 : r->counter;
}

void keep_last(SbLast *last, const SbResult *r, const SbEstimate *e) {
    detail_values(r, last->detail);
    last->score = e->score;
    last->has_last = 1;
    last->results++;
    if (e->loads != NULL && (r->quality == SB_VALID || r->quality == SB_UNPROTECTED)) {
        memcpy(last->loads, e->loads, sizeof last->loads);
        last->has_valid = 1;
        last->ready = r->time;
        last->age = r->age;
    }
}

void status_values(const SbLast *last, const SbAccount *account, double time, int configuration, double *value) {
    int64_t rejected = 0;
    for (int k = 0; k < SB_N_CLASSES; k++) {
        rejected += k == SB_USED ? 0 : account->count[k];
    }
    const int64_t count[] = {account->received, account->count[SB_USED], rejected, (int64_t)last->results,
                             account->count[SB_OVERRUN]};
    memset(value, 0, N_STATUS * sizeof *value);
    for (int k = 0; k < N_LOADS_SENT; k++) {
        value[S_LAST + k] = last->has_valid ? last->loads[k] : NAN;
        value[S_COUNTS + k] = (double)((uint64_t)count[k] & 0xFFFFFFFFu);
        value[S_COUNTS_16 + k] = (double)((uint64_t)count[k] & 0xFFFFu);
    }
    const double age = last->has_valid ? 1e3 * (time - last->ready + last->age) : NAN;
    value[S_AGE] = at_most(age, 4294967294.0);
    value[S_AGE_16] = at_most(age, 655340.0);
    value[S_QUALITY] = last->has_last ? last->detail[D_QUALITY] : (double)SB_NO_DATA;
    value[S_DRIFT] = NAN; /* which earlier versions have measured */
    value[S_SCORE] = last->has_last ? last->score : NAN;
    value[S_CONFIGURATION] = configuration;
}

void last_details(const SbLast *last, double *value) {
    memset(value, 0, N_DETAILS * sizeof *value);
    value[D_UNCERTAINTY] = NAN;
    if (last->has_last) {
        memcpy(value, last->detail, sizeof last->detail);
    }
}

double sent_value(double estimate, double step) {
    const double steps = estimate / step;
    if (step == 0.0) {
        return estimate;
    }
    if (!(steps >= 0.0 && steps <= 65534.0)) { /* above the range there is none */
        return NAN;
    }
    const double whole = (double)(int32_t)steps;
    return step * (whole < steps ? whole + 1.0 : whole);
}
