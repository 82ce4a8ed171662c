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
