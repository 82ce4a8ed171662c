/* A tare by the edges of its input, or of a whole window of readings at once; its state in bytes.

       IDLE -- rising edge --> AVERAGING -- falling edge, nothing speaks against it --> DONE, zero offsets in use
                                   |------- falling edge, a fault; q above its limit ---> REFUSED, zero offsets as before

   While the input is true each step adds its readings to a window. The falling edge judges the
   window (both in tare_judge.c). A dynamic pressure that is not known or above its limit ends the tare at once: loads on the
   gauges are not known then. New zero offsets go into use with their standard deviations, for which matrices are
   renewed (renewal.c). docs/howto/tare.md, "In an FMU" and "When it is refused". */

#include "zeros.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

/* One line for the log of an FMU: why a tare was refused, the first reason that applies, or what it has taken.
   Strain is in um/m, gauges are counted from 1. docs/howto/tare.md, "When it is refused". */

#define MICRO 1e6 /* of strain, in messages */

static int has(const TareVerdict *verdict, int fault) {
    return ((int)verdict->faults & fault) != 0;
}

static void reason(const Tare *tare, char text[MODEL_TEXT_SIZE]) {
    const TareVerdict *v = &tare->verdict;
    const TareLimits *limits = &tare->limits;
    if (has(v, TARE_NO_PRESSURE)) {
        snprintf(text, MODEL_TEXT_SIZE, "loads are not known: no dynamic pressure");
    } else if (has(v, TARE_PRESSURE)) {
        snprintf(text, MODEL_TEXT_SIZE, "loads are not known: dynamic pressure is %.4g Pa, expected at most %g Pa",
                 v->dynamic_pressure, limits->dynamic_pressure);
    } else if (has(v, TARE_SHORT)) {
        snprintf(text, MODEL_TEXT_SIZE, "window: expected at least %.0f steps, got %.0f", limits->least_samples,
                 v->samples);
    } else if (has(v, TARE_DRIFTS)) {
        snprintf(text, MODEL_TEXT_SIZE,
                 "readings drift: gauge %.0f by %.3g um/m over the window, expected at most %g um/m",
                 v->drifting_gauge, MICRO * v->drift, MICRO * limits->drift);
    } else if (has(v, TARE_MOVES)) {
        snprintf(text, MODEL_TEXT_SIZE,
                 "readings move: gauge %.0f by %.3g um/m rms, expected at most %g times its noise of %.3g um/m",
                 v->moving_gauge, MICRO * v->scatter, limits->loud,
                 MICRO * limits->noise_std[(size_t)v->moving_gauge - 1]);
    } else if (has(v, TARE_TOO_LARGE)) {
        snprintf(text, MODEL_TEXT_SIZE, "no plausible zero: gauge %.0f reads %.4g um/m, expected at most %g um/m",
                 v->largest_gauge, MICRO * v->largest, MICRO * limits->zero);
    } else if (has(v, TARE_LIKE_LOAD)) {
        snprintf(text, MODEL_TEXT_SIZE,
                 "readings look like load: %.3g um/m of them lie along the strain of flights, expected at most %.3g um/m "
                 "of random zeros",
                 MICRO * v->along, MICRO * v->along_limit);
    } else {
        snprintf(text, MODEL_TEXT_SIZE, "%.0f of %lu gauges read", v->gauges, (unsigned long)tare->n_gauges);
    }
}

/* The first of what speaks against the zeros. */
static void say_refused(Tare *tare) {
    char why[MODEL_TEXT_SIZE];
    reason(tare, why);
    tare->to_report = 1;
    snprintf(tare->text, sizeof tare->text, "tare refused: %.200s; zeros as before", why);
}

static void say_taken(Tare *tare) {
    const TareVerdict *v = &tare->verdict;
    tare->to_report = 1;
    snprintf(tare->text, sizeof tare->text,
             "tare taken: %.0f zeros from %.0f steps, rms %.4g um/m, standard deviations up to %.2g um/m each and %.2g "
             "um/m in common",
             v->gauges, v->samples, MICRO * v->rms, MICRO * v->largest_std, MICRO * tare->zero[2 * tare->n_gauges]);
}

#define LARGEST_READING 1e100 /* whose square, and the sum of many of those, are finite */

/* All arrays; zeros and window, which are serialised, come first. */
static void lay_out(void *part, Room *room) {
    Tare *tare = part;
    const size_t n = tare->n_gauges;
    tare->zero = taken(room, 2 * n + 1);
    window_arrays(&tare->window, n, room);
    tare->judged = taken(room, 2 * n + 1);
    TAKE(room, n, &tare->statistics.mean, &tare->statistics.scatter);
    tare->statistics.stretch = taken(room, MAX_STRETCHES * n);
    tare->reading = taken(room, n);
    tare->scratch = taken(room, judge_doubles(n, tare->limits.n_patterns));
    tare->statistics.reads = piece(room, n, 1);
}

int tare_create(MapFile *file, size_t n_gauges, double largest_zero, Tare *tare) {
    if (!map_has(file, "tare")) {
        return file->good;
    }
    MAP_READ(file, "tare", TARE, TareLimits, &tare->limits);
    tare->n_gauges = n_gauges;
    tare->largest_zero = largest_zero;
    tare->present = map_hand_out(file, lay_out, tare);
    return tare->present;
}

int tare_like(const Tare *other, Memory *memory, Tare *tare) {
    *tare = *other;
    tare->present = other->present && memory_hand_out(memory, lay_out, tare);
    tare_reset(tare);
    return tare->present == other->present;
}

void tare_reset(Tare *tare) {
    if (tare->present) {
        tare->up = tare->to_report = 0;
        tare->flags = (TareFlags){.state = TARE_IDLE};
        tare->verdict = (TareVerdict){0};
        memset(tare->zero, 0, (2 * tare->n_gauges + 1) * sizeof *tare->zero);
        window_begin(&tare->window);
    }
}

static int refuse(Tare *tare) {
    tare->flags.state = TARE_REFUSED;
    say_refused(tare);
    return 0;
}

/* Judge the readings in the window; whether its zeros may be used. */
static int judge_window(Tare *tare) {
    tare->verdict = (TareVerdict){.samples = tare->window.counts.samples};
    if (tare->window.counts.samples < tare->limits.least_samples) {
        tare->verdict.faults = TARE_SHORT;
    } else {
        window_statistics(&tare->window, tare->limits.least_part, &tare->statistics);
        tare_judge(tare);
    }
    return tare->verdict.faults == 0.0;
}

static int finish(Tare *tare) {
    if (!judge_window(tare)) {
        return refuse(tare);
    }
    memcpy(tare->zero, tare->judged, (2 * tare->n_gauges + 1) * sizeof *tare->zero);
    tare->flags.has_zeros = 1.0;
    tare->flags.state = TARE_DONE;
    say_taken(tare);
    return 1;
}

/* Edges of the input; whether there are new zero offsets. */
int tare_follow(Tare *tare) {
    const int was_up = tare->flags.is_up != 0.0;
    tare->flags.is_up = tare->up;
    if (tare->up && !was_up) {
        tare->flags.state = TARE_AVERAGING;
        tare->verdict = (TareVerdict){0};
        window_begin(&tare->window);
    }
    return was_up && !tare->up && tare_is_averaging(tare) && finish(tare);
}

void tare_take(Tare *tare, double dynamic_pressure) {
    if (!tare_is_averaging(tare)) {
        return;
    }
    if (isnan(dynamic_pressure) || fabs(dynamic_pressure) > tare->limits.dynamic_pressure) {
        tare->verdict = (TareVerdict){.samples = tare->window.counts.samples, .dynamic_pressure = dynamic_pressure};
        tare->verdict.faults = isnan(dynamic_pressure) ? TARE_NO_PRESSURE : TARE_PRESSURE;
        refuse(tare);
    } else {
        window_add(&tare->window, tare->reading);
    }
}

void tare_set_reading(Tare *tare, const double *strain) {
    for (size_t i = 0; i < tare->n_gauges; i++) {
        tare->reading[i] = isfinite(strain[i]) && fabs(strain[i]) <= LARGEST_READING ? strain[i] : NAN;
    }
}

void tare_whole(Tare *tare, size_t count, const double *strain, const double *dynamic_pressure) {
    double largest = 0.0, without = 0.0;
    window_begin(&tare->window);
    for (size_t k = 0; k < count; k++) {
        tare_set_reading(tare, strain + k * tare->n_gauges);
        window_add(&tare->window, tare->reading);
        if (isfinite(dynamic_pressure[k])) {
            largest = fabs(dynamic_pressure[k]) > largest ? fabs(dynamic_pressure[k]) : largest;
        } else {
            without += 1.0;
        }
    }
    judge_window(tare);
    tare->verdict.dynamic_pressure = largest;
    tare->verdict.samples_without = without;
    tare->verdict.faults += largest > tare->limits.dynamic_pressure ? (double)TARE_PRESSURE : 0.0;
    window_begin(&tare->window);
}

void tare_drop(Tare *tare) {
    tare->flags.has_zeros = 0.0;
    if (!tare_is_averaging(tare)) {
        tare->flags.state = TARE_IDLE;
    }
}

/* State: flags, the input, counts of the window, then the arrays of zeros and window, which follow each other. */

enum { N_FLAGS = sizeof(TareFlags) / sizeof(double), ARRAYS_AT = sizeof(TareFlags) + sizeof(double) + sizeof(WindowCounts) };

static size_t array_size(const Tare *tare) {
    return (2 * tare->n_gauges + 1 + window_doubles(tare->n_gauges)) * sizeof(double);
}

size_t tare_state_size(const Tare *tare) {
    return tare->present ? ARRAYS_AT + array_size(tare) : 0;
}

void tare_write_state(const Tare *tare, unsigned char *bytes) {
    const double up = tare->up;
    if (tare->present) {
        memcpy(bytes, &tare->flags, sizeof tare->flags);
        memcpy(bytes + sizeof tare->flags, &up, sizeof up);
        memcpy(bytes + sizeof tare->flags + sizeof up, &tare->window.counts, sizeof tare->window.counts);
        memcpy(bytes + ARRAYS_AT, tare->zero, array_size(tare));
    }
}

void tare_read_state(Tare *tare, const unsigned char *bytes) {
    if (tare->present) {
        memcpy(&tare->flags, bytes, sizeof tare->flags);
        tare->up = double_at(bytes, N_FLAGS) != 0.0;
        memcpy(&tare->window.counts, bytes + (N_FLAGS + 1) * sizeof(double), sizeof tare->window.counts);
        memcpy(tare->zero, bytes + ARRAYS_AT, array_size(tare));
        tare->verdict = (TareVerdict){0};
        tare->to_report = 0;
    }
}

/* Arrays in the bytes need not be aligned: numbers are copied one by one. */
static int arrays_fit(const Tare *tare, const unsigned char *bytes) {
    const size_t n = tare->n_gauges;
    int good = 1;
    for (size_t k = 0; k < array_size(tare) / sizeof(double); k++) {
        const double value = double_at(bytes, k), least = k < n ? -tare->largest_zero : 0.0;
        good = good && isfinite(value) && (k > 2 * n || (value >= least && value <= tare->largest_zero));
    }
    return good;
}

int tare_state_fits(const Tare *tare, const unsigned char *bytes) {
    TareFlags flags;
    WindowCounts counts;
    if (!tare->present) {
        return 1;
    }
    memcpy(&flags, bytes, sizeof flags);
    memcpy(&counts, bytes + (N_FLAGS + 1) * sizeof(double), sizeof counts);
    return is_flag(flags.is_up) && is_flag(flags.has_zeros) && is_flag(double_at(bytes, N_FLAGS))
        && (flags.state == (double)TARE_IDLE || flags.state == (double)TARE_AVERAGING || flags.state == (double)TARE_DONE
            || flags.state == (double)TARE_REFUSED)
        && window_counts_fit(&counts) && arrays_fit(tare, bytes + ARRAYS_AT);
}

/* Records of a tare: limits that a caller may replace, and the outcome, in the order of the structures TareFlags and
   TareVerdict, which hold float64 alone and are copied as they are. docs/howto/tare.md. */

const char *const TARE_LIMIT_NAMES[N_TARE_LIMITS] = {"dynamic_pressure", "zero", "drift"};

const char *const TARE_VERDICT_NAMES[N_TARE_VERDICT] = {
    "faults",           "samples",         "memory",         "gauges", "rms",          "largest_std",
    "dynamic_pressure", "samples_without", "drifting_gauge", "drift",  "moving_gauge", "moving_scatter",
    "largest_gauge",    "largest",         "along",          "along_limit",
};

void use_limits(Tare *tare, const TareLimits *of_map, const double *limits) {
    tare->limits = *of_map;
    if (limits != NULL) {
        tare->limits.dynamic_pressure = limits[0];
        tare->limits.zero = limits[1];
        tare->limits.drift = limits[2];
        tare->limits.known_strain = limits + N_TARE_LIMITS;
        tare->limits.known_std = tare->limits.known_strain + tare->n_gauges;
    }
}

void write_tare(const Tare *tare, const double *zero, double *outcome) {
    const size_t n = tare->n_gauges;
    memcpy(outcome, zero, (2 * n + 1) * sizeof *outcome);
    outcome += 2 * n + 1;
    for (size_t i = 0; i < n; i++) {
        outcome[i] = (double)tare->statistics.reads[i];
    }
    memcpy(outcome + n, tare->statistics.scatter, n * sizeof *outcome);
    outcome += 2 * n;
    memcpy(outcome, &tare->flags, sizeof tare->flags);
    memcpy(outcome + sizeof tare->flags / sizeof *outcome, &tare->verdict, sizeof tare->verdict);
}
