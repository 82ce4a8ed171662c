#include "step_parts.h"

#include <math.h>

void coefficient_scales(double pressure, double area, double length, double *scale) {
    scale[0] = scale[1] = scale[2] = 1.0 / (pressure * area);
    scale[3] = scale[4] = 1.0 / (pressure * (area * length));
}

void set_unknown_from(double *output, int first, int end) {
    for (int i = first; i < end; i++) {
        output[i] = NAN;
    }
}

void set_unknown(double *output) {
    set_unknown_from(output, COEFFICIENTS, HEALTH_STATE);
    set_unknown_from(output, CHI_SQUARE, VALID_GAUGES);
    output[ENVELOPE_SCORE] = NAN;
}

double known_input(const Estimator *e, size_t scalar) {
    const double value = e->input[e->map.n_gauges + scalar];
    return value > 0.0 ? value : NAN;
}

double moment_shift(const Estimator *e) {
    return e->input[e->map.n_gauges + MOMENT_STATION] - e->map.moment_station;
}

/* Deviations of the coefficients by the error of the dynamic pressure. */
static void of_pressure(const Flow *flow, const double *scale, const double *coefficients, const double *per_pressure,
                        double *deviation) {
    for (size_t i = 0; i < N_LOADS; i++) {
        deviation[i] = (scale[i] * per_pressure[i] - coefficients[i] / flow->pressure) * flow->deviation;
    }
}

void map_coefficients(const Estimator *e, const LoadStatistics *found, double *coefficients, double *covariance) {
    double scale[N_LOADS], deviation[N_LOADS];
    coefficient_scales(e->flow.pressure, e->map.reference_area, e->map.reference_length, scale);
    for (size_t i = 0; i < N_LOADS; i++) {
        coefficients[i] = scale[i] * found->loads[i];
    }
    of_pressure(&e->flow, scale, coefficients, found->per_pressure, deviation);
    for (size_t i = 0; i < N_LOADS; i++) {
        for (size_t j = 0; j < N_LOADS; j++) {
            covariance[i * N_LOADS + j] =
                scale[i] * found->covariance[i * N_LOADS + j] * scale[j] + deviation[i] * deviation[j];
        }
    }
}

void set_envelope_score(Estimator *e, const LoadStatistics *found) {
    if (e->map.envelope.n_half_spaces == 0) {
        e->output[ENVELOPE_SCORE] = 0.0;
        return;
    }
    double coefficients[N_LOADS], covariance[N_LOADS * N_LOADS];
    map_coefficients(e, found, coefficients, covariance);
    e->output[ENVELOPE_SCORE] = envelope_score(&e->map.envelope, &e->half_spaces, e->wide, coefficients,
                                               covariance);
}
