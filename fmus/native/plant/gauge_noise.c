#include "gauge_noise.h"

#include <string.h>

/* The finalizer of SplitMix64 (Steele, Lea & Flood, OOPSLA 2014). */
static uint64_t mixed(uint64_t x) {
    x = (x ^ (x >> 30)) * UINT64_C(0xBF58476D1CE4E5B9);
    x = (x ^ (x >> 27)) * UINT64_C(0x94D049BB133111EB);
    return x ^ (x >> 31);
}

double gauge_noise(const double *table, uint64_t seed, uint64_t sample, uint64_t gauge) {
    const uint64_t step = UINT64_C(0x9E3779B97F4A7C15);
    const uint64_t bits = mixed(mixed(mixed(seed + step) + sample * step + step) + gauge * step + step);
    /* A probability from 2^-54 to below 1/2: its octave and where it lies in there choose the quantile. */
    const double probability = ((double)(bits >> 12) + 0.5) * (1.0 / 9007199254740992.0);
    uint64_t pattern;
    memcpy(&pattern, &probability, sizeof pattern);
    const size_t octave = (size_t)(1021 - (pattern >> 52));
    pattern = (pattern & UINT64_C(0x000FFFFFFFFFFFFF)) | UINT64_C(0x3FF0000000000000);
    double fraction;
    memcpy(&fraction, &pattern, sizeof fraction); /* 1 <= fraction < 2 */
    const double argument = 2.0 * fraction - 3.0, *coefficient = table + octave * NOISE_COEFFICIENTS;
    double quantile = coefficient[NOISE_COEFFICIENTS - 1];
    for (int k = NOISE_COEFFICIENTS - 2; k >= 0; k--) {
        quantile = quantile * argument + coefficient[k];
    }
    return bits & 1u ? -quantile : quantile;
}
