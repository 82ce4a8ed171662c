#include "linear_outputs.h"

#include <math.h>
#include <string.h>

#include "../update/scaled_form.h"
#include "scaled_suspects.h"
#include "suspects.h"

/* Loads about the moment point of the map, their covariance and their derivative by q_inf. */
typedef struct {
    const double *loads, *covariance, *per_pressure;
} LoadStatistics;

static const double NO_SLOPE[N_LOADS] = {0.0};

/* Deviations of the coefficients by the error of the dynamic pressure. */
static void of_pressure(const Flow *flow, const double *scale, const double *coefficients, const double *per_pressure,
                        double *deviation) {
    for (size_t i = 0; i < N_LOADS; i++) {
        deviation[i] = (scale[i] * per_pressure[i] - coefficients[i] / flow->pressure) * flow->deviation;
    }
}

/* Coefficients at the references of the map, and their covariance. */
static void map_coefficients(const Linear *linear, const LoadStatistics *found, double *coefficients, double *covariance) {
    double scale[N_LOADS], deviation[N_LOADS];
    coefficient_scales(linear->flow.pressure, linear->map->reference_area, linear->map->reference_length, scale);
    for (size_t i = 0; i < N_LOADS; i++) {
        coefficients[i] = scale[i] * found->loads[i];
    }
    of_pressure(&linear->flow, scale, coefficients, found->per_pressure, deviation);
    for (size_t i = 0; i < N_LOADS; i++) {
        for (size_t j = 0; j < N_LOADS; j++) {
            covariance[i * N_LOADS + j] =
                scale[i] * found->covariance[i * N_LOADS + j] * scale[j] + deviation[i] * deviation[j];
        }
    }
}

/* The output ENVELOPE_SCORE, where the dynamic pressure is known. */
static void set_envelope_score(Linear *linear, const LoadStatistics *found) {
    if (linear->map->envelope.n_half_spaces == 0) {
        linear->output[ENVELOPE_SCORE] = 0.0;
        return;
    }
    double coefficients[N_LOADS], covariance[N_LOADS * N_LOADS];
    map_coefficients(linear, found, coefficients, covariance);
    linear->output[ENVELOPE_SCORE] = envelope_score(&linear->map->envelope, &linear->half_spaces, linear->wide, coefficients,
                                               covariance);
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

/* Loads of the step, and their deviations. */
static void set_absolute_loads(Linear *linear) {
    MaskedMap *m = linear->prepared.masked;
    double *output = linear->output;
    const double shift = moment_shift(linear->inputs);
    if (shift != m->load_std_shift) {
        set_load_std(m, shift);
    }
    memcpy(output + LOADS, linear->absolute.loads, sizeof linear->absolute.loads);
    if (linear->flow.known) {
        const LoadStatistics found = {linear->absolute.loads, m->load_covariance, NO_SLOPE};
        set_envelope_score(linear, &found);
    } else {
        output[ENVELOPE_SCORE] = NAN;
    }
    move_moments(shift, output + LOADS);
    memcpy(output + LOADS_STD, m->load_std, sizeof m->load_std);
}

/* Coefficients, if the dynamic pressure is known. */
static void set_absolute_coefficients(const Linear *linear, double *output) {
    const double *scalar = linear->inputs->value + linear->map->n_gauges;
    if (!linear->flow.known) {
        set_unknown_from(output, COEFFICIENTS, LOADS);
        return;
    }
    const double fraction = linear->flow.deviation / linear->flow.pressure;
    double scale[N_LOADS];
    coefficient_scales(linear->flow.pressure, scalar[REFERENCE_AREA], scalar[REFERENCE_LENGTH], scale);
    for (size_t i = 0; i < N_LOADS; i++) {
        const double coefficient = scale[i] * output[LOADS + i], of_loads = scale[i] * output[LOADS_STD + i];
        const double of_pressure = coefficient * fraction;
        output[COEFFICIENTS + i] = coefficient;
        output[COEFFICIENTS_STD + i] =
            fraction > 0.0 ? sqrt(of_loads * of_loads + of_pressure * of_pressure) : of_loads;
    }
}

void absolute_outputs(Linear *linear) {
    double *output = linear->output;
    const MaskedMap *m = linear->prepared.masked;
    const Map *map = linear->map;
    const double alarm_scale = scalar_input(linear->inputs, ALARM_SCALE);
    absolute_condition(map, linear->wide, m, linear->inputs->strain, &linear->absolute);
    output[CHI_SQUARE] = linear->absolute.chi_square;
    output[CHI_SQUARE_LIMIT] = alarm_scale * (map->chi_square_scale * m->chi_square_limit);
    set_suspects(linear, sqrt(alarm_scale * map->outlier_scale) * m->outlier_threshold);
    set_absolute_loads(linear);
    set_absolute_coefficients(linear, output);
}

static void set_scaled_coefficients(Linear *linear, const ScaledStep *step) {
    const double *scalar = linear->inputs->value + linear->map->n_gauges;
    const double q = linear->flow.pressure, q_std = linear->flow.deviation, shift = moment_shift(linear->inputs);
    double *output = linear->output, per_pressure[N_LOADS], scale[N_LOADS];
    memcpy(output + LOADS, step->loads, sizeof step->loads);
    memcpy(per_pressure, step->per_pressure, sizeof per_pressure);
    move_moments(shift, output + LOADS);
    move_moments(shift, per_pressure);
    coefficient_scales(q, scalar[REFERENCE_AREA], scalar[REFERENCE_LENGTH], scale);
    for (size_t i = 0; i < N_LOADS; i++) {
        double with_force;
        const double variance =
            i < 3 ? step->covariance[i * N_LOADS + i] : moved_variance(step->covariance, i, shift, &with_force);
        const double of_pressure = per_pressure[i] * q_std, coefficient = scale[i] * output[LOADS + i];
        const double of_both = (scale[i] * per_pressure[i] - coefficient / q) * q_std;
        output[LOADS_STD + i] = sqrt(variance + of_pressure * of_pressure);
        output[COEFFICIENTS + i] = coefficient;
        output[COEFFICIENTS_STD + i] = sqrt(scale[i] * scale[i] * variance + of_both * of_both);
    }
}

void scaled_outputs(Linear *linear) {
    const Map *map = linear->map;
    const MaskedMap *m = linear->prepared.masked;
    const ScaledStep *step = &linear->scaled.step;
    scaled_condition(&linear->scaled, m, linear->flow.pressure, linear->inputs->strain);
    const double limits = scalar_input(linear->inputs, ALARM_SCALE) * step->expected_ratio;
    linear->output[CHI_SQUARE] = step->chi_square;
    linear->output[CHI_SQUARE_LIMIT] = map->chi_square_scale * m->chi_square_limit * limits;
    set_scaled_suspects(linear, m->outlier_threshold * sqrt(map->outlier_scale * limits));
    const LoadStatistics found = {step->loads, step->covariance, step->per_pressure};
    set_envelope_score(linear, &found);
    set_scaled_coefficients(linear, step);
}
