/* Outputs of a step of a linear map, from the conditioned loads f (5) with covariance cov f and derivative df/dq.

   The error of q, of standard deviation s_q, is a part of all. With scale = 1 / (q S), 1 / (q S L) for moments,

       loads          sigma^2 = var f + (df/dq s_q)^2
       coefficients   C = scale f,    sigma^2 = scale^2 var f + ((scale df/dq - C / q) s_q)^2

   A moment about a point `shift` further aft is M' = M + shift F, of the variance var M + 2 shift cov(M, F) +
   shift^2 var F. Limits of chi-square and z rise with alarm_scale and with the expected chi-square of the current
   strain (limit_ratio). The margin to the envelope is computed at the references of the map, with the covariance
   scale cov f scale' + the same error of q. docs/explanation/theory.md, "What a sigma is made of";
   strainfmu/estimator/reference/linear.py. */

#include "linear.h"

#include <math.h>
#include <string.h>

/* The gauge that does not fit the others: the largest leave-one-out residual z_i = (P r)_i / sqrt(P_ii).

   All z cost a product of n^2. A screen in float shows first, with a bound of its own error, that no |z| can be
   above the threshold, as in nearly every step; only where it leaves that open are they computed in double. So the
   screen decides about time, never about a result.

       z_i^2 = (V_i' x)^2 / P_ii,    x = u w,    y_i = V_i' x / |V_i| in float,
       z_i^2 <= (|y_i| + error margin_i)^2 bound_i,    bound_i >= |V_i|^2 / P_ii,    margin_i >= sqrt(P_ii) / |V_i|.

   bound and margin belong to the interval of the pressure ratio (update/current_errors.c). Gauges whose residuals
   always move together cannot be distinguished and are named together: groups of update/prepared.c.
   docs/explanation/theory.md, "Missing and suspect gauges"; docs/explanation/alarm_levels.md has the thresholds. */

/* |w|^2 up to which float holds w and the products with it. */
#define LARGEST_SCREENED 0x1p40

/* Whether some |z| may be above the limit. z^2 = (V_i' x)^2 / P_ii, where y = V_i' x / |V_i| was found in float and is wrong
   by no more than error * margin; bound is no less than |V_i|^2 / P_ii. A number that is not finite counts as above. */
EVERYWHERE int any_above(size_t n, const float *restrict y, const double *restrict margin, const double *restrict bound,
                         double error, double square) {
    int below = 1;
    for (size_t i = 0; i < n; i++) {
        const double largest = fabs((double)y[i]) + error * margin[i] + 1e-30;
        below &= largest * largest * bound[i] <= square;
    }
    return !below;
}

/* 0 only if no |z| is above the threshold, found in float in a fraction of the time that z takes.

   Let u = 2^-24. Rounding V_i and x to float, multiplying and adding n terms in any order is wrong by at most (n + 2) u
   |V_i|' |x| to first order (Higham, Accuracy and Stability of Numerical Algorithms, section 3.1). Twice that covers the
   second order (n <= 4096). With x = D (D w) it is at most (n + 4) 2^-23 sum_a |V_ai| u_a |w_a|, which by Cauchy and
   Schwarz is at most the root of chi-square times the root of P_ii with all gauges. 1e-5 of the limit covers all rounding in
   double. By the same inequality no z^2 is above chi-square: a small chi-square needs no products. Where chi-square
   shows a fault, some |z| is above as a rule: nothing would be gained. */
EVERYWHERE int may_exceed(Linear *linear, double threshold) {
    const size_t n = linear->map->n_gauges;
    ScaledStep *step = &linear->scaled.step;
    const double chi_square = step->chi_square, limit = threshold * threshold * (1.0 - 1e-5);
    if (chi_square <= limit) {
        return 0;
    }
    if (linear->map->has_low_rank) { /* which has all z at little cost */
        return 1;
    }
    if (!(chi_square <= LARGEST_SCREENED) || chi_square > linear->output[CHI_SQUARE_LIMIT]) {
        return 1;
    }
    const Interval *interval = step->interval;
    if (!(step->n_lost == 0 ? interval->bounded : step->bounded)) {
        return 1;
    }
    const double *bound = step->n_lost == 0 ? interval->bound : step->bound;
    for (size_t a = 0; a < n; a++) {
        step->narrow[a] = (float)step->x[a];
    }
    narrow_times(linear->wide, n, n, linear->scaled.screen, step->narrow, step->narrow_z);
    const double error = (double)(n + 4) * 0x1p-23 * sqrt(chi_square);
    return any_above(n, step->narrow_z, interval->margin, bound, error, limit);
}

FOR_AVX2_AS(int, may_exceed, (Linear *linear, double threshold), (linear, threshold))

/* Set the outputs for the gauge in use of that index. */
static void name_suspects(Linear *linear, size_t worst) {
    const MaskedMap *m = linear->prepared.masked;
    const size_t *group = linear->prepared.group;
    size_t suspects = 0;
    for (size_t k = 0; k < m->n_used; k++) {
        suspects += group[k] == group[worst];
    }
    linear->output[SUSPECT_GAUGE] = (double)(m->used[group[worst]] + 1);
    linear->output[SUSPECTS] = (double)suspects;
}

/* If some |z| is above the threshold, set the outputs SUSPECT_GAUGE and SUSPECTS: the gauge of the
   largest |z|, and the number of those from which it cannot be distinguished. The step, CHI_SQUARE
   and its limit must be set. */
static void set_suspects(Linear *linear, double threshold) {
    const MaskedMap *m = linear->prepared.masked;
    if (!CHOSEN(linear->wide, may_exceed)(linear, threshold)) {
        return;
    }
    double *z = linear->scaled.step.z;
    size_t worst = 0;
    double largest = 0.0;
    scaled_standardised_residuals(&linear->scaled, z);
    for (size_t k = 0; k < m->n_used; k++) {
        const double size = fabs(z[m->used[k]]);
        if (size > largest) {
            largest = size;
            worst = k;
        }
    }
    if (largest > threshold) {
        prepared_group(&linear->prepared, worst);
        name_suspects(linear, worst);
    }
}

/* (scale df/dq - C / q) s_q of each coefficient. */
static void of_pressure(const Flow *flow, const double *scale, const double *coefficients, const double *per_pressure,
                        double *deviation) {
    for (size_t i = 0; i < N_LOADS; i++) {
        deviation[i] = (scale[i] * per_pressure[i] - coefficients[i] / flow->pressure) * flow->deviation;
    }
}

/* The margin to the envelope: coefficients C (5) against the half-spaces n_j' C <= limit_j that the snapshots of the map
   lie in. It is the largest distance beyond one, in its own standard deviations:

       score = max over j of (n_j' C - limit_j) / sqrt(n_j' cov(C) n_j),      0 where C is inside all.

   n' cov n = sum over i <= k of (2 - [i = k]) n_i n_k cov_ik, so that `products` (n_half_spaces, 15) times the 15
   entries of the covariance gives all variances by one product, and only where some half-space is left at all.
   Squares are compared: one root in the end. docs/explanation/envelope.md, "The envelope margin";
   strainfmu/estimator/valid_ranges.py. */

#define N_ENTRIES 15 /* of a symmetric (5, 5) matrix */

void half_space_arrays(const Envelope *envelope, Linear *linear, Room *room) {
    const size_t m = envelope->n_half_spaces, rows = dense_rows(m), columns = dense_columns(N_ENTRIES);
    linear->products = taken(room, rows * columns);
    linear->variance = taken(room, rows);
    for (size_t j = 0; linear->products != NULL && j < m; j++) {
        double *panel = linear->products + j / ROWS * ROWS * columns + j % ROWS;
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

/* The largest (n'C - limit) / sigma over the half-spaces, 0 where C is inside all. Coefficients (5) and their covariance
   (5, 5) are those at the references of the map. */
static double envelope_score(const Linear *linear, const double *coefficients, const double *covariance) {
    const Envelope *envelope = &linear->map->envelope;
    const int wide = linear->wide;
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
    dense_times(wide, envelope->n_half_spaces, N_ENTRIES, linear->products, entries, linear->variance);
    CHOSEN(wide, square_scores)(envelope, coefficients, linear->variance);
    double largest = 0.0;
    for (size_t j = 0; j < envelope->n_half_spaces; j++) {
        largest = linear->variance[j] > largest ? linear->variance[j] : largest;
    }
    return sqrt(largest);
}

/* C at the references of the map, and its covariance. */
static void map_coefficients(const Linear *linear, const ScaledStep *step, double *coefficients, double *covariance) {
    double scale[N_LOADS], deviation[N_LOADS];
    coefficient_scales(linear->flow.pressure, linear->map->reference_area, linear->map->reference_length, scale);
    for (size_t i = 0; i < N_LOADS; i++) {
        coefficients[i] = scale[i] * step->loads[i];
    }
    of_pressure(&linear->flow, scale, coefficients, step->per_pressure, deviation);
    for (size_t i = 0; i < N_LOADS; i++) {
        for (size_t j = 0; j < N_LOADS; j++) {
            covariance[i * N_LOADS + j] =
                scale[i] * step->covariance[i * N_LOADS + j] * scale[j] + deviation[i] * deviation[j];
        }
    }
}

/* The output ENVELOPE_SCORE; 0 without a dynamic pressure. */
static void set_envelope_score(Linear *linear, const ScaledStep *step) {
    if (!linear->flow.known || linear->map->envelope.n_half_spaces == 0) {
        linear->output[ENVELOPE_SCORE] = 0.0;
        return;
    }
    double coefficients[N_LOADS], covariance[N_LOADS * N_LOADS];
    map_coefficients(linear, step, coefficients, covariance);
    linear->output[ENVELOPE_SCORE] = envelope_score(linear, coefficients, covariance);
}

/* Load k, of value and variance at the q of the step and with df/dq, and its coefficient, which is not known without q. */
static void put(const Linear *linear, size_t k, double value, double variance, double per_pressure) {
    const double q = linear->flow.pressure, deviation = linear->flow.deviation;
    const LoadOutput out = load_output(linear->output, linear->other_loads, k);
    const double scale = linear->flow.known ? 1.0 / (q * own_reference(linear->inputs, out.is_moment)) : NAN;
    const double of_pressure = per_pressure * deviation, coefficient = scale * value;
    const double of_both = (scale * per_pressure - coefficient / q) * deviation;
    *out.value = value;
    *out.std = sqrt(variance + of_pressure * of_pressure);
    *out.coefficient = coefficient;
    *out.coefficient_std = sqrt(scale * scale * variance + of_both * of_both);
}

/* The five about the moment point of the settings. */
static void put_five(const Linear *linear, const ScaledStep *step) {
    const double shift = moment_shift(linear->inputs), *covariance = step->covariance;
    double loads[N_LOADS], per_pressure[N_LOADS];
    memcpy(loads, step->loads, sizeof loads);
    memcpy(per_pressure, step->per_pressure, sizeof per_pressure);
    move_moments(shift, loads);
    move_moments(shift, per_pressure);
    for (size_t i = 0; i < N_LOADS; i++) {
        double variance = covariance[i * N_LOADS + i];
        if (i >= N_FORCES) {
            const double cross = covariance[i * N_LOADS + i - 2], of_force = covariance[(i - 2) * (N_LOADS + 1)];
            variance = (variance + shift * cross) + shift * (cross + shift * of_force);
        }
        put(linear, i, loads[i], variance, per_pressure[i]);
    }
}

void linear_outputs(Linear *linear) {
    const Map *map = linear->map;
    const MaskedMap *m = linear->prepared.masked;
    const ScaledStep *step = &linear->scaled.step;
    scaled_condition(&linear->scaled, m, linear->flow.pressure, linear->inputs->strain);
    const double limits = scalar_input(linear->inputs, ALARM_SCALE) * step->limit_ratio;
    linear->output[CHI_SQUARE] = step->chi_square;
    linear->output[CHI_SQUARE_LIMIT] = map->chi_square_scale * m->chi_square_limit * limits;
    set_suspects(linear, m->outlier_threshold * sqrt(map->outlier_scale * limits));
    set_envelope_score(linear, step);
    put_five(linear, step);
}

/* Loads in addition to the five by the linear estimator, computed when they are read.

   Value f_j, variance and df_j/dq come from the last conditioned step (scaled_form.c, scaled_other_load). The error
   of q adds to both as for the five, sigma^2 = var f + (df/dq s_q)^2 for the load and scale^2 var f + (scale df/dq
   s_q - C s_q / q)^2 for the coefficient (linear_outputs.c). NaN without identified state or q.
   docs/explanation/dynamic_pressure.md, "Weights at any dynamic pressure". */

void linear_other_loads_update(Linear *linear) {
    const int known = linear->prepared.masked->identified && linear->flow.known;
    for (size_t k = N_LOADS; k < linear->scaled.n_loads; k++) {
        double value = NAN, variance = NAN, per_pressure = NAN;
        if (known) {
            scaled_other_load(&linear->scaled, k, &value, &variance, &per_pressure);
        }
        put(linear, k, value, variance, per_pressure);
    }
}

/* What noise that is independent from sample to sample adds to the errors of the linear estimator: nu of the filter.

   With the gain G (5, n) of the step and variances nu_g of each gauge's noise, and the part b of the variance of q
   that is independent,

       nu of load i         = sum over gauges of nu_g G_ig^2 + b (df_i/dq s_q)^2
       nu of coefficient i  = scale^2 sum over gauges of nu_g G_ig^2 + b ((scale df_i/dq - C_i / q) s_q)^2

   at moment point and references of the settings: the gain of a moment is G_M + shift G_F. Whether q is lower or
   higher moves the load and its scale together, so that their difference is squared. docs/explanation/filter.md,
   "Model". */

size_t linear_noise_row(const Map *map) {
    return dense_rows(map->n_gauges);
}

static double noise_of(size_t n, const double *gauge_noise, const double *gain) {
    double sum = 0.0;
    for (size_t g = 0; g < n; g++) {
        sum += gauge_noise[g] * (gain[g] * gain[g]);
    }
    return sum;
}

static double square(double x) {
    return x * x;
}

void linear_noise(Linear *linear, size_t k, const double *gauge_noise, double of_pressure, double *gain, double noise[2]) {
    const size_t n = linear->map->n_gauges;
    const LoadOutput out = load_output(linear->output, linear->other_loads, k);
    const double shift = k < N_LOADS && out.is_moment ? moment_shift(linear->inputs) : 0.0, q = linear->flow.pressure;
    const double scale = 1.0 / (q * own_reference(linear->inputs, out.is_moment));
    double per_pressure = scaled_gain(&linear->scaled, k, gain);
    if (shift != 0.0) {
        double *of_force = gain + linear_noise_row(linear->map);
        per_pressure += shift * scaled_gain(&linear->scaled, k - 2, of_force);
        add_times(n, shift, of_force, gain);
    }
    const double strain = noise_of(n, gauge_noise, gain), of_both = scale * per_pressure - *out.coefficient / q;
    noise[0] = strain + of_pressure * square(per_pressure * linear->flow.deviation);
    noise[1] = scale * scale * strain + of_pressure * square(of_both * linear->flow.deviation);
}
