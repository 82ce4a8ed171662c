#include "envelope.h"

#include <math.h>

#include "wide.h"

/* p(h) [Pa]; NaN where h is not known or outside the table. */
static double ambient_pressure(const Envelope *envelope, double altitude) {
    const size_t top = envelope->n_altitudes - 1;
    const double position = altitude / envelope->altitude_step;
    if (!(position >= 0.0 && position <= (double)top)) {
        return NAN;
    }
    const size_t whole = (size_t)position, index = whole < top ? whole : top - 1;
    const double below = envelope->ambient_pressure[index], above = envelope->ambient_pressure[index + 1];
    return below + (position - (double)index) * (above - below);
}

/* Whether a value leaves a range; one that is not known does not. */
static int leaves(const double *range, double value) {
    return value < range[0] || value > range[1];
}

int outside_by_navigation(const Envelope *envelope, const Flow *flow) {
    const double mach = flow->mach_number;
    if (leaves(envelope->dynamic_pressure, flow->pressure) || leaves(envelope->mach_number, mach)
        || leaves(envelope->altitude, flow->altitude)) {
        return 1;
    }
    const double expected = envelope->half_gamma * mach * mach * ambient_pressure(envelope, flow->altitude);
    const double allowed = envelope->pressure_tolerance * expected + 3.0 * flow->deviation;
    return fabs(flow->pressure - expected) > allowed;
}

/* n'C - limit of half-space j. */
EVERYWHERE double excess_of(const Envelope *envelope, const double *coefficients, size_t j) {
    const size_t m = envelope->n_half_spaces;
    double sum = envelope->direction[j] * coefficients[0];
    for (size_t i = 1; i < N_LOADS; i++) {
        sum += envelope->direction[i * m + j] * coefficients[i];
    }
    return sum - envelope->limit[j];
}

/* Whether some n'C is above its limit. */
EVERYWHERE int beyond(const Envelope *envelope, const double *coefficients) {
    int above = 0;
    for (size_t j = 0; j < envelope->n_half_spaces; j++) {
        above |= excess_of(envelope, coefficients, j) > 0.0;
    }
    return above;
}

#if HAS_AVX2
AVX2 static int beyond_avx2(const Envelope *envelope, const double *coefficients) {
    return beyond(envelope, coefficients);
}
#endif

/* n'K n of half-space j for a symmetric K (5, 5). */
static double form_of(const Envelope *envelope, size_t j, const double *matrix) {
    double sum = 0.0;
    for (size_t i = 0; i < N_LOADS; i++) {
        double row = 0.0;
        for (size_t k = 0; k < N_LOADS; k++) {
            row += matrix[i * N_LOADS + k] * envelope->direction[k * envelope->n_half_spaces + j];
        }
        sum += row * envelope->direction[i * envelope->n_half_spaces + j];
    }
    return sum;
}

double envelope_score(const Envelope *envelope, int wide, const double *coefficients, const double *covariance,
                      size_t *worst) {
    double score = 0.0;
    *worst = SIZE_MAX;
    if (!CHOSEN(wide, beyond)(envelope, coefficients)) {
        return score;
    }
    for (size_t j = 0; j < envelope->n_half_spaces; j++) {
        const double excess = excess_of(envelope, coefficients, j);
        if (excess > 0.0) {
            const double deviations = excess / sqrt(form_of(envelope, j, covariance));
            if (deviations > score) {
                score = deviations;
                *worst = j;
            }
        }
    }
    return score;
}

double envelope_score_derivative(const Envelope *envelope, size_t worst, double score, const double *covariance,
                                 const double *d_coefficients, const double *d_covariance) {
    if (worst == SIZE_MAX) {
        return 0.0;
    }
    double change = 0.0;
    for (size_t i = 0; i < N_LOADS; i++) {
        change += envelope->direction[i * envelope->n_half_spaces + worst] * d_coefficients[i];
    }
    const double variance = form_of(envelope, worst, covariance);
    return change / sqrt(variance) - 0.5 * score * form_of(envelope, worst, d_covariance) / variance;
}
