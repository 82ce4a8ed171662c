/* Records of a tare: limits that a caller may replace, and the outcome, in the order of the structures TareFlags and
   TareVerdict, which hold float64 alone and are copied as they are. docs/howto/tare.md. */

#include "tare_record.h"

#include <string.h>

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
