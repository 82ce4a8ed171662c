#include <math.h>
#include <string.h>

#include "../numerics/dense.h"
#include "../numerics/triangles.h"
#include "../step_parts.h"
#include "scaled_form.h"

/* Derivatives of a step: along a change ds of the pressure ratio and of the strains.

   du = -2 s lambda u^2 ds, d(s^2 S u) = 2 s S u^2 ds, d(s^2 u) = 2 s u^2 ds; all 0 for free directions. The lost gauges
   are predicted so that V_R' (u w) = 0; with w = w_K + V_R r this gives T'T dr = -V_R' (du w + u dw_K). */
typedef struct {
    double ds;
    double loads[N_LOADS], per_pressure[N_LOADS], covariance[N_LOADS * N_LOADS], chi_square, expected_ratio;
} Change;

double scaled_unresolved_change(const Estimator *e, size_t a, double ds) {
    const ScaledStep *step = &e->scaled.step;
    const double singular = e->map.form.singular[a], u = step->unresolved[a];
    return a < e->map.form.n_free ? 0.0 : -2.0 * step->ratio * (singular * u) * (singular * u) * ds;
}

/* Change of a vector w = w_K + V_R r of directions, of which d_w holds that of w_K. */
static void complete(Estimator *e, const double *w, double ds, double *d_w) {
    const size_t n = e->map.n_gauges;
    const ScaledStep *step = &e->scaled.step;
    double *r = e->scaled.work[1] + 8 * n; /* (n_lost) */
    for (size_t j = 0; j < step->n_lost; j++) {
        const double *column = e->map.form.whitening + step->lost[j] * n;
        r[j] = 0.0;
        for (size_t a = 0; a < n; a++) {
            r[j] -= column[a] * (scaled_unresolved_change(e, a, ds) * w[a] + step->unresolved[a] * d_w[a]);
        }
    }
    solve_transposed(n, step->n_lost, step->matrix, r);
    solve_triangle(n, step->n_lost, step->matrix, r);
    for (size_t j = 0; j < step->n_lost; j++) {
        const double *column = e->map.form.whitening + step->lost[j] * n;
        for (size_t a = 0; a < n; a++) {
            d_w[a] += r[j] * column[a];
        }
    }
}

/* Add factor (x y' + y x') to a (5, 5) matrix. */
static void add_pair(double factor, const double *x, const double *y, double *matrix) {
    for (size_t i = 0; i < N_LOADS; i++) {
        for (size_t j = 0; j < N_LOADS; j++) {
            matrix[i * N_LOADS + j] += factor * (x[i] * y[j] + x[j] * y[i]);
        }
    }
}

/* Change of the covariance but for errors at the current strain: of directions, unseen load and lost gauges. What the
   lost add is B (T'T)^-1 B' = Y' V_R' D^2 V_R Y with Y = T^-1 X; Z = V_R Y. */
static void derive_covariance(Estimator *e, Change *change) {
    const size_t n = e->map.n_gauges, n_lost = e->scaled.step.n_lost;
    const ScaledStep *step = &e->scaled.step;
    const ScaledForm *form = &e->map.form;
    const double s = step->ratio, ds = change->ds;
    double *y = e->scaled.work[0]; /* (5, n_lost) */
    memcpy(y, step->growth, N_LOADS * n_lost * sizeof *y);
    for (size_t i = 0; i < N_LOADS; i++) {
        solve_triangle(n, n_lost, step->matrix, y + i * n_lost);
    }
    for (size_t k = 0; k < N_LOADS * N_LOADS; k++) {
        change->covariance[k] = 2.0 * s * ds * form->unseen[k];
    }
    for (size_t a = 0; a < n; a++) {
        const double *load = form->load + N_LOADS * a, u = step->unresolved[a];
        const double faster = a < form->n_free ? 0.0 : 2.0 * s * u * u * ds; /* of s^2 u */
        double z[N_LOADS] = {0.0};
        for (size_t j = 0; j < n_lost; j++) {
            const double whitening = form->whitening[step->lost[j] * n + a];
            for (size_t i = 0; i < N_LOADS; i++) {
                z[i] += whitening * y[i * n_lost + j];
            }
        }
        add_pair(0.5 * faster, load, load, change->covariance);
        if (n_lost > 0) {
            add_pair(faster * form->singular[a], load, z, change->covariance);
            add_pair(-0.5 * scaled_unresolved_change(e, a, ds), z, z, change->covariance);
        }
    }
}

/* Change of loads, of their derivative by q_inf, of covariance and chi-square, for a change of the residuals in
   e->scaled.residual. */
static void derive_loads(Estimator *e, Change *change) {
    const size_t n = e->map.n_gauges;
    const ScaledStep *step = &e->scaled.step;
    const ScaledForm *form = &e->map.form;
    double *d_w = step->scratch[0], *d_mean = step->scratch[1], ds = change->ds;
    dense_times(e->wide, n, n, e->scaled.rows, e->scaled.residual, d_w);
    memset(d_mean, 0, n * sizeof *d_mean);
    complete(e, step->w, ds, d_w);
    complete(e, step->of_mean, ds, d_mean);
    change->chi_square = 0.0;
    for (size_t i = 0; i < N_LOADS; i++) {
        change->loads[i] = form->load_of_mean[i] * ds;
        change->per_pressure[i] = 0.0;
    }
    for (size_t a = 0; a < n; a++) {
        const double u = step->unresolved[a], weight = step->weight[a];
        const double d_weight = a < form->n_free ? 0.0 : 2.0 * step->ratio * form->singular[a] * u * u * ds;
        change->chi_square += scaled_unresolved_change(e, a, ds) * step->w[a] * step->w[a] + 2.0 * step->x[a] * d_w[a];
        for (size_t i = 0; i < N_LOADS; i++) {
            const double load = form->load[N_LOADS * a + i];
            change->loads[i] += load * (d_weight * step->w[a] + weight * d_w[a]);
            change->per_pressure[i] -= load * (d_weight * step->of_mean[a] + weight * d_mean[a]);
        }
    }
    for (size_t i = 0; i < N_LOADS; i++) {
        change->per_pressure[i] /= e->map.dynamic_pressure;
    }
    derive_covariance(e, change);
}

/* Change of what errors at the current strain add. */
static void derive_errors(Estimator *e, double d_pressure, Change *change) {
    const ScaledStep *step = &e->scaled.step;
    const Map *map = &e->map;
    const int freedom = map->degrees_of_freedom - (int)step->n_lost;
    change->expected_ratio = 0.0;
    if (!map->form.has_errors) {
        return;
    }
    const Level *low = step->levels[0], *high = step->levels[1];
    double c[1 + N_LOADS] = {1.0}, d_c[1 + N_LOADS] = {0.0}, scale[N_LOADS], d_product[N_PAIRS + 3] = {0.0};
    double d_low[N_VALUES], d_high[N_VALUES];
    coefficient_scales(e->flow.pressure, map->reference_area, map->reference_length, scale);
    for (size_t i = 0; i < N_LOADS; i++) {
        c[1 + i] = scale[i] * step->loads[i];
        d_c[1 + i] = scale[i] * change->loads[i] - c[1 + i] * d_pressure / e->flow.pressure;
    }
    size_t pair = 0;
    for (size_t a = 0; a < 6; a++) {
        for (size_t b = a; b < 6; b++, pair++) {
            d_product[pair] = d_c[a] * c[b] + c[a] * d_c[b];
        }
    }
    dense_times(e->wide, N_VALUES, N_PAIRS, low->products, d_product, d_low);
    dense_times(e->wide, N_VALUES, N_PAIRS, high->products, d_product, d_high);
    const double s = step->ratio, ds = change->ds, d_part = ds / step->distance;
    double d_value[N_VALUES];
    for (size_t v = 0; v < N_VALUES; v++) {
        const double excess = (1.0 - step->part) * step->low[v] + step->part * step->high[v];
        const double d_excess = d_part * (step->high[v] - step->low[v]) + (1.0 - step->part) * d_low[v]
                              + step->part * d_high[v];
        d_value[v] = 2.0 * s * ds * excess + s * s * d_excess;
    }
    double matrix[N_LOADS * N_LOADS];
    set_symmetric(d_value, matrix);
    for (size_t k = 0; k < N_LOADS * N_LOADS; k++) {
        change->covariance[k] += matrix[k];
    }
    if (freedom > 0 && !step->held) {
        change->expected_ratio = d_value[N_VALUES - 1] / (double)freedom;
    }
}

/* Derivatives of loads and coefficients about the moment point that is set, and of their deviations. */
static void derive_outputs(const Estimator *e, const double *d_scalar, const Change *change, double *d_output) {
    const ScaledStep *step = &e->scaled.step;
    const double *scalar = e->input + e->map.n_gauges, *output = e->output;
    const double q = e->flow.pressure, q_std = e->flow.deviation, d_std = derive_deviation(e, d_scalar);
    const double shift = moment_shift(e), d_shift = d_scalar[MOMENT_STATION], growth = d_scalar[DYNAMIC_PRESSURE] / q;
    double *d_loads = d_output + LOADS, per_pressure[N_LOADS], d_per[N_LOADS], scale[N_LOADS];
    memcpy(d_loads, change->loads, sizeof change->loads);
    memcpy(per_pressure, step->per_pressure, sizeof per_pressure);
    memcpy(d_per, change->per_pressure, sizeof d_per);
    move_moments(shift, d_loads);
    move_moments(shift, per_pressure);
    move_moments(shift, d_per);
    coefficient_scales(q, scalar[REFERENCE_AREA], scalar[REFERENCE_LENGTH], scale);
    for (size_t i = 0; i < N_LOADS; i++) {
        double with_force = 0.0, unused, variance = step->covariance[i * N_LOADS + i];
        double d_variance = change->covariance[i * N_LOADS + i];
        if (i >= 3) {
            variance = moved_variance(step->covariance, i, shift, &with_force);
            d_variance = moved_variance(change->covariance, i, shift, &unused) + 2.0 * d_shift * with_force;
            d_loads[i] += d_shift * step->loads[i - 2];
            d_per[i] += d_shift * step->per_pressure[i - 2];
        }
        const double of_pressure = per_pressure[i] * q_std;
        d_output[LOADS_STD + i] =
            (0.5 * d_variance + of_pressure * (d_per[i] * q_std + per_pressure[i] * d_std)) / output[LOADS_STD + i];
        double shrink = growth + d_scalar[REFERENCE_AREA] / scalar[REFERENCE_AREA];
        shrink += i < 3 ? 0.0 : d_scalar[REFERENCE_LENGTH] / scalar[REFERENCE_LENGTH];
        const double coefficient = output[COEFFICIENTS + i];
        const double d_coefficient = scale[i] * d_loads[i] - shrink * coefficient;
        const double slope = scale[i] * per_pressure[i] - coefficient / q;
        const double d_slope =
            scale[i] * (d_per[i] - shrink * per_pressure[i]) - (d_coefficient - growth * coefficient) / q;
        d_output[COEFFICIENTS + i] = d_coefficient;
        d_output[COEFFICIENTS_STD + i] =
            (scale[i] * scale[i] * (0.5 * d_variance - shrink * variance)
             + slope * q_std * (d_slope * q_std + slope * d_std))
            / output[COEFFICIENTS_STD + i];
    }
}

void scaled_derivative(Estimator *e, const double *d_input, double *d_output) {
    const size_t n = e->map.n_gauges;
    const double *d_scalar = d_input + n;
    const ScaledStep *step = &e->scaled.step;
    const double d_pressure = d_scalar[DYNAMIC_PRESSURE], alarm_scale = e->input[n + ALARM_SCALE];
    Change change = {.ds = d_pressure / e->map.dynamic_pressure};
    for (size_t i = 0; i < n; i++) {
        e->scaled.residual[i] = e->masked->mask[i] ? d_input[i] - change.ds * e->map.form.mean_strain[i] : 0.0;
    }
    derive_loads(e, &change);
    derive_errors(e, d_pressure, &change);
    derive_outputs(e, d_scalar, &change, d_output);
    if (e->further.present) {
        ScaledChange known = {.ds = change.ds, .pressure = d_pressure};
        memcpy(known.loads, change.loads, sizeof known.loads);
        further_derivative(e, d_scalar, &known, d_output + N_DERIVATIVES);
    }
    d_output[CHI_SQUARE] = change.chi_square;
    const double d_limits = d_scalar[ALARM_SCALE] * step->expected_ratio + alarm_scale * change.expected_ratio;
    if (d_limits != 0.0) { /* the limit may be infinite */
        d_output[CHI_SQUARE_LIMIT] = e->map.chi_square_scale * e->masked->chi_square_limit * d_limits;
    }
    const LoadStatistics found = {step->loads, step->covariance, step->per_pressure};
    const LoadStatistics changes = {change.loads, change.covariance, change.per_pressure};
    d_output[ENVELOPE_SCORE] =
        derive_envelope_score(e, &found, &changes, d_pressure, derive_deviation(e, d_scalar));
}
