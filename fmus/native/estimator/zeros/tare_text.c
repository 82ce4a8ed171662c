/* One line for the log of an FMU: why a tare was refused, the first reason that applies, or what it has taken.
   Strain is in um/m, gauges are counted from 1. docs/howto/tare.md, "When it is refused". */

#include "tare_text.h"

#include <math.h>
#include <stdio.h>

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

void say_refused(Tare *tare) {
    char why[MODEL_TEXT_SIZE];
    reason(tare, why);
    tare->to_report = 1;
    snprintf(tare->text, sizeof tare->text, "tare refused: %.200s; zeros as before", why);
}

void say_taken(Tare *tare) {
    const TareVerdict *v = &tare->verdict;
    tare->to_report = 1;
    snprintf(tare->text, sizeof tare->text,
             "tare taken: %.0f zeros from %.0f steps, rms %.4g um/m, standard deviations up to %.2g um/m each and %.2g "
             "um/m in common",
             v->gauges, v->samples, MICRO * v->rms, MICRO * v->largest_std, MICRO * tare->zero[2 * tare->n_gauges]);
}
