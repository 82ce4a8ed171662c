#include "absolute_form.h"

#include <math.h>
#include <string.h>

#include "../numerics/panels.h"
#include "../numerics/triangles.h"
#include "../step_parts.h"
#include "suspects.h"

static const double NO_SLOPE[N_LOADS] = {0.0};

/* Sum of the gains of the gauges in use, weighted with x: loads that strains x stand for. */
static void gain_times(const MaskedMap *m, const double *restrict x, double *restrict loads) {
    double even[LOAD_STRIDE] = {0.0}, odd[LOAD_STRIDE] = {0.0};
    size_t k = 0;
    for (; k + 2 <= m->n_used; k += 2) {
        const double *restrict gain = m->load_gain + LOAD_STRIDE * k;
        for (size_t i = 0; i < LOAD_STRIDE; i++) {
            even[i] += gain[i] * x[k];
            odd[i] += gain[i + LOAD_STRIDE] * x[k + 1];
        }
    }
    if (k < m->n_used) {
        for (size_t i = 0; i < LOAD_STRIDE; i++) {
            even[i] += m->load_gain[LOAD_STRIDE * k + i] * x[k];
        }
    }
    for (size_t i = 0; i < N_LOADS; i++) {
        loads[i] = even[i] + odd[i];
    }
}

/* Deviations of the loads, which change only with the gauges in use and the moment point. */
static void set_load_std(MaskedMap *m, double shift) {
    for (size_t i = 0; i < N_LOADS; i++) {
        double with_force;
        const double variance =
            i < 3 ? m->load_covariance[i * N_LOADS + i] : moved_variance(m->load_covariance, i, shift, &with_force);
        m->load_std[i] = sqrt(variance);
    }
    m->load_std_shift = shift;
}

static void set_loads(Estimator *e) {
    MaskedMap *m = e->masked;
    double *output = e->output;
    const double shift = moment_shift(e);
    if (shift != m->load_std_shift) {
        set_load_std(m, shift);
    }
    gain_times(m, e->residual, output + LOADS);
    for (size_t i = 0; i < N_LOADS; i++) {
        output[LOADS + i] += e->map.load_of_mean[i];
    }
    if (e->flow.known) {
        const LoadStatistics found = {output + LOADS, m->load_covariance, NO_SLOPE};
        set_envelope_score(e, &found);
    } else {
        output[ENVELOPE_SCORE] = NAN;
    }
    move_moments(shift, output + LOADS);
    memcpy(output + LOADS_STD, m->load_std, sizeof m->load_std);
}

/* Coefficients, if the dynamic pressure is known. */
static void set_coefficients(const Estimator *e, double *output) {
    const double *scalar = e->input + e->map.n_gauges;
    if (!e->flow.known) {
        set_unknown_from(output, COEFFICIENTS, LOADS);
        return;
    }
    const double fraction = e->flow.deviation / e->flow.pressure;
    double scale[N_LOADS];
    coefficient_scales(e->flow.pressure, scalar[REFERENCE_AREA], scalar[REFERENCE_LENGTH], scale);
    for (size_t i = 0; i < N_LOADS; i++) {
        const double coefficient = scale[i] * output[LOADS + i], of_loads = scale[i] * output[LOADS_STD + i];
        const double of_pressure = coefficient * fraction;
        output[COEFFICIENTS + i] = coefficient;
        output[COEFFICIENTS_STD + i] =
            fraction > 0.0 ? sqrt(of_loads * of_loads + of_pressure * of_pressure) : of_loads;
    }
}

/* What the strains in use differ by from those of the mean state. */
static void set_residual(Estimator *e) {
    const MaskedMap *m = e->masked;
    if (m->n_used == e->map.n_gauges) {
        for (size_t k = 0; k < m->n_used; k++) {
            e->residual[k] = e->strain[k] - m->mean_strain[k];
        }
        return;
    }
    for (size_t k = 0; k < m->n_used; k++) {
        e->residual[k] = e->strain[m->used[k]] - m->mean_strain[k];
    }
}

void absolute_update(Estimator *e) {
    double *output = e->output;
    const MaskedMap *m = e->masked;
    const Map *map = &e->map;
    const double alarm_scale = e->input[map->n_gauges + ALARM_SCALE];
    set_residual(e);
    panels_times(e->wide, m->n_used, m->row_panels, e->residual, e->whitened);
    output[CHI_SQUARE] = dot(m->n_used, e->whitened, e->whitened);
    output[CHI_SQUARE_LIMIT] = alarm_scale * (map->chi_square_scale * m->chi_square_limit);
    set_suspects(e, sqrt(alarm_scale * map->outlier_scale) * m->outlier_threshold);
    set_loads(e);
    set_coefficients(e, output);
}

/* Derivatives of loads, their deviations, the score and chi-square; d_residual is that of the strains in use. */
static void derive_loads(Estimator *e, const double *d_residual, const double *d_scalar, double *d_output) {
    const MaskedMap *m = e->masked;
    static const double NO_CHANGE[N_LOADS * N_LOADS] = {0.0};
    const double shift = moment_shift(e), d_shift = d_scalar[MOMENT_STATION];
    gain_times(m, d_residual, d_output + LOADS);
    if (e->flow.known) {
        double loads[N_LOADS];
        memcpy(loads, e->output + LOADS, sizeof loads);
        move_moments(-shift, loads);
        const LoadStatistics found = {loads, m->load_covariance, NO_SLOPE};
        const LoadStatistics change = {d_output + LOADS, NO_CHANGE, NO_SLOPE};
        d_output[ENVELOPE_SCORE] =
            derive_envelope_score(e, &found, &change, d_scalar[DYNAMIC_PRESSURE], derive_deviation(e, d_scalar));
    } else {
        d_output[ENVELOPE_SCORE] = NAN;
    }
    move_moments(shift, d_output + LOADS);
    for (size_t i = 3; i < N_LOADS; i++) {
        double with_force;
        const double variance = moved_variance(m->load_covariance, i, shift, &with_force);
        d_output[LOADS + i] += d_shift * e->output[LOADS + i - 2];
        d_output[LOADS_STD + i] = with_force * d_shift / sqrt(variance);
    }
    /* d|W r|^2 = 2 (W r)' W dr. */
    panels_times(e->wide, m->n_used, m->row_panels, d_residual, e->d_whitened);
    d_output[CHI_SQUARE] = 2.0 * dot(m->n_used, e->whitened, e->d_whitened);
}

static void derive_coefficients(const Estimator *e, const double *d_scalar, double *d_output) {
    const double *scalar = e->input + e->map.n_gauges, *output = e->output;
    const double pressure = e->flow.pressure, fraction = e->flow.deviation / pressure;
    const double d_fraction = (derive_deviation(e, d_scalar) - fraction * d_scalar[DYNAMIC_PRESSURE]) / pressure;
    double scales[N_LOADS];
    coefficient_scales(pressure, scalar[REFERENCE_AREA], scalar[REFERENCE_LENGTH], scales);
    for (size_t i = 0; i < N_LOADS; i++) {
        const double scale = scales[i];
        double growth = d_scalar[DYNAMIC_PRESSURE] / pressure + d_scalar[REFERENCE_AREA] / scalar[REFERENCE_AREA];
        growth += i < 3 ? 0.0 : d_scalar[REFERENCE_LENGTH] / scalar[REFERENCE_LENGTH];
        const double coefficient = output[COEFFICIENTS + i];
        const double derivative = scale * d_output[LOADS + i] - coefficient * growth;
        const double of_loads = scale * output[LOADS_STD + i], of_pressure = coefficient * fraction;
        const double d_of_loads = scale * d_output[LOADS_STD + i] - of_loads * growth;
        const double d_of_pressure = derivative * fraction + coefficient * d_fraction;
        d_output[COEFFICIENTS + i] = derivative;
        d_output[COEFFICIENTS_STD + i] =
            (of_loads * d_of_loads + of_pressure * d_of_pressure) / output[COEFFICIENTS_STD + i];
    }
}

void absolute_derivative(Estimator *e, const double *d_input, double *d_output) {
    const MaskedMap *m = e->masked;
    const double *d_scalar = d_input + e->map.n_gauges;
    for (size_t k = 0; k < m->n_used; k++) {
        e->residual[k] = d_input[m->used[k]];
    }
    derive_loads(e, e->residual, d_scalar, d_output);
    if (d_scalar[ALARM_SCALE] != 0.0) { /* the limit may be infinite */
        d_output[CHI_SQUARE_LIMIT] = d_scalar[ALARM_SCALE] * (e->map.chi_square_scale * m->chi_square_limit);
    }
    if (e->flow.known) {
        derive_coefficients(e, d_scalar, d_output);
    } else {
        set_unknown_from(d_output, COEFFICIENTS, LOADS);
    }
}
