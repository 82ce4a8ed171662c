/* Outputs of a step of a linear map, from the conditioned loads f (5) with covariance cov f and derivative df/dq.

   The error of q, of standard deviation s_q, is a part of all. With scale = 1 / (q S), 1 / (q S L) for moments,

       loads          sigma^2 = var f + (df/dq s_q)^2
       coefficients   C = scale f,    sigma^2 = scale^2 var f + ((scale df/dq - C / q) s_q)^2

   A moment about a point `shift` further aft is M' = M + shift F, of the variance var M + 2 shift cov(M, F) +
   shift^2 var F. Limits of chi-square and z rise with alarm_scale and with the expected chi-square of the current
   strain (limit_ratio). The margin to the envelope is computed at the references of the map, with the covariance
   scale cov f scale' + the same error of q (envelope.c). docs/explanation/theory.md, "What a sigma is made of";
   strainfmu/estimator/reference/linear.py. */

#include "linear_outputs.h"

#include <math.h>
#include <string.h>

#include "../update/scaled_form.h"
#include "suspects.h"

/* (scale df/dq - C / q) s_q of each coefficient. */
static void of_pressure(const Flow *flow, const double *scale, const double *coefficients, const double *per_pressure,
                        double *deviation) {
    for (size_t i = 0; i < N_LOADS; i++) {
        deviation[i] = (scale[i] * per_pressure[i] - coefficients[i] / flow->pressure) * flow->deviation;
    }
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
    linear->output[ENVELOPE_SCORE] = envelope_score(&linear->map->envelope, &linear->half_spaces, linear->wide, coefficients,
                                               covariance);
}

/* Loads about the moment point of the settings, with the error of the dynamic pressure if it is known. */
static void set_loads(Linear *linear, const ScaledStep *step, double *per_pressure, double *variance) {
    const double shift = moment_shift(linear->inputs);
    double *output = linear->output;
    memcpy(output + LOADS, step->loads, sizeof step->loads);
    memcpy(per_pressure, step->per_pressure, sizeof step->per_pressure);
    move_moments(shift, output + LOADS);
    move_moments(shift, per_pressure);
    for (size_t i = 0; i < N_LOADS; i++) {
        double with_force;
        const double of_pressure = per_pressure[i] * linear->flow.deviation;
        variance[i] = i < 3 ? step->covariance[i * N_LOADS + i] : moved_variance(step->covariance, i, shift, &with_force);
        output[LOADS_STD + i] = sqrt(variance[i] + of_pressure * of_pressure);
    }
}

/* C at the references of the settings, and standard deviations. */
static void set_coefficients(Linear *linear, const double *per_pressure, const double *variance) {
    const double *scalar = linear->inputs->value + linear->map->n_gauges;
    const double q = linear->flow.pressure, q_std = linear->flow.deviation;
    double *output = linear->output, scale[N_LOADS];
    coefficient_scales(q, scalar[REFERENCE_AREA], scalar[REFERENCE_LENGTH], scale);
    for (size_t i = 0; i < N_LOADS; i++) {
        const double coefficient = scale[i] * output[LOADS + i];
        const double of_both = (scale[i] * per_pressure[i] - coefficient / q) * q_std;
        output[COEFFICIENTS + i] = coefficient;
        output[COEFFICIENTS_STD + i] = sqrt(scale[i] * scale[i] * variance[i] + of_both * of_both);
    }
}

void linear_outputs(Linear *linear) {
    const Map *map = linear->map;
    const MaskedMap *m = linear->prepared.masked;
    const ScaledStep *step = &linear->scaled.step;
    double per_pressure[N_LOADS], variance[N_LOADS];
    scaled_condition(&linear->scaled, m, linear->flow.pressure, linear->inputs->strain);
    const double limits = scalar_input(linear->inputs, ALARM_SCALE) * step->limit_ratio;
    linear->output[CHI_SQUARE] = step->chi_square;
    linear->output[CHI_SQUARE_LIMIT] = map->chi_square_scale * m->chi_square_limit * limits;
    set_suspects(linear, m->outlier_threshold * sqrt(map->outlier_scale * limits));
    set_envelope_score(linear, step);
    set_loads(linear, step, per_pressure, variance);
    if (linear->flow.known) {
        set_coefficients(linear, per_pressure, variance);
    } else {
        set_unknown_from(linear->output, COEFFICIENTS, LOADS);
    }
}
