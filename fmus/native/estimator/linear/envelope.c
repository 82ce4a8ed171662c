/* Whether an estimate and its flight state are inside what the snapshots of the map cover.

   The coefficients C (5) of the snapshots lie in the half-spaces n_j' C <= limit_j. The margin is the largest
   distance beyond one, in its own standard deviations:

       score = max over j of (n_j' C - limit_j) / sqrt(n_j' cov(C) n_j),      0 where C is inside all.

   n' cov n = sum over i <= k of (2 - [i = k]) n_i n_k cov_ik, so that `products` (n_half_spaces, 15) times the 15
   entries of the covariance gives all variances by one product, and only where some half-space is left at all.
   Squares are compared: one root in the end.

   The flow is outside where q, M or h leave their ranges (M by three stated standard deviations), or where M and h
   contradict q: |q - gamma/2 M^2 p(h)| > tolerance of it + three standard deviations of q.
   docs/explanation/envelope.md, "What is compared" and "The envelope margin"; strainfmu/estimator/map/validity.py. */

#include "envelope.h"

#include <math.h>

#include "../numerics/dense.h"
#include "../numerics/wide.h"

#define N_ENTRIES 15 /* of a symmetric (5, 5) matrix */
#define RANGE_DEVIATIONS 3.0 /* of a stated Mach number by which it may leave its range, and of q_inf */

void half_space_arrays(const Envelope *envelope, HalfSpaces *spaces, Room *room) {
    const size_t m = envelope->n_half_spaces, rows = dense_rows(m), columns = dense_columns(N_ENTRIES);
    spaces->products = taken(room, rows * columns);
    spaces->variance = taken(room, rows);
    for (size_t j = 0; spaces->products != NULL && j < m; j++) {
        double *panel = spaces->products + j / ROWS * ROWS * columns + j % ROWS;
        size_t at = 0;
        for (size_t i = 0; i < N_LOADS; i++) {
            for (size_t k = i; k < N_LOADS; k++) {
                const double product = envelope->direction[i * m + j] * envelope->direction[k * m + j];
                /* Row j of the panel: entries off the diagonal count twice. */
                panel[ROWS * at++] = i == k ? product : 2.0 * product;
            }
        }
    }
}

/* Whether a value leaves a range by more than so much; one that is not known does not. */
static int leaves(const double *range, double value, double slack) {
    return value < range[0] - slack || value > range[1] + slack;
}

int outside_by_navigation(const Envelope *envelope, const Flow *flow) {
    const double mach = flow->mach_number;
    if (leaves(envelope->dynamic_pressure, flow->pressure, 0.0)
        || leaves(envelope->mach_number, mach, RANGE_DEVIATIONS * flow->mach_deviation)
        || leaves(envelope->altitude, flow->altitude, 0.0)) {
        return 1;
    }
    /* Without both nothing contradicts q. */
    if (isnan(mach) || isnan(flow->altitude)) {
        return 0;
    }
    const double expected = envelope->half_gamma * mach * mach * ambient_pressure(envelope, flow->altitude);
    const double allowed = envelope->pressure_tolerance * expected + RANGE_DEVIATIONS * flow->deviation;
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

FOR_AVX2_AS(int, beyond, (const Envelope *envelope, const double *coefficients), (envelope, coefficients))

/* Squares of (n'C - limit) / sigma instead of the variances, 0 for half-spaces that C does not leave. */
EVERYWHERE void square_scores(const Envelope *envelope, const double *coefficients, double *restrict variance) {
    for (size_t j = 0; j < envelope->n_half_spaces; j++) {
        const double excess = excess_of(envelope, coefficients, j), square = excess * excess / variance[j];
        variance[j] = excess > 0.0 ? square : 0.0;
    }
}

FOR_AVX2(square_scores, (const Envelope *envelope, const double *coefficients, double *variance),
         (envelope, coefficients, variance))

double envelope_score(const Envelope *envelope, const HalfSpaces *spaces, int wide, const double *coefficients,
                      const double *covariance) {
    if (!CHOSEN(wide, beyond)(envelope, coefficients)) {
        return 0.0;
    }
    double entries[N_ENTRIES + 1] = {0.0};
    size_t at = 0;
    for (size_t i = 0; i < N_LOADS; i++) {
        for (size_t k = i; k < N_LOADS; k++) {
            entries[at++] = covariance[i * N_LOADS + k];
        }
    }
    dense_times(wide, envelope->n_half_spaces, N_ENTRIES, spaces->products, entries, spaces->variance);
    CHOSEN(wide, square_scores)(envelope, coefficients, spaces->variance);
    double largest = 0.0;
    for (size_t j = 0; j < envelope->n_half_spaces; j++) {
        largest = spaces->variance[j] > largest ? spaces->variance[j] : largest;
    }
    return sqrt(largest);
}
