/* What noise that is independent from sample to sample adds to the errors of the linear estimator: nu of the filter.

   With the gain G (5, n) of the step and variances nu_g of each gauge's noise, and the part b of the variance of q
   that is independent,

       nu of load i         = sum over gauges of nu_g G_ig^2 + b (df_i/dq s_q)^2
       nu of coefficient i  = scale^2 sum over gauges of nu_g G_ig^2 + b ((scale df_i/dq - C_i / q) s_q)^2

   at moment point and references of the settings: the gain of a moment is G_M + shift G_F. Whether q is lower or
   higher moves the load and its scale together, so that their difference is squared. docs/explanation/filter.md,
   "Model". */

#include "linear_noise.h"

#include "../numerics/dense.h"
#include "../update/scaled_form.h"

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

void linear_noise(const Linear *linear, const double *gauge_noise, double of_pressure, double *scratch, double *of_loads,
                  double *of_coefficients) {
    const size_t n = linear->map->n_gauges, row = linear_noise_row(linear->map);
    const double *scalar = linear->inputs->value + n, *output = linear->output;
    const double shift = moment_shift(linear->inputs), q = linear->flow.pressure, deviation = linear->flow.deviation;
    double per_pressure[N_LOADS], scale[N_LOADS];
    memcpy(per_pressure, linear->scaled.step.per_pressure, sizeof per_pressure);
    move_moments(shift, per_pressure);
    coefficient_scales(q, scalar[REFERENCE_AREA], scalar[REFERENCE_LENGTH], scale);
    for (size_t i = 0; i < N_LOADS; i++) {
        scaled_gain(&linear->scaled, i, scratch + i * row);
    }
    for (size_t i = 0; i < N_LOADS; i++) {
        double *gain = scratch + i * row;
        /* Rows of forces stand before rows of moments and are not moved: i - 2 is the force of moment i. */
        for (size_t g = 0; g < n && i >= 3; g++) {
            gain[g] += shift * scratch[(i - 2) * row + g];
        }
        const double strain = noise_of(n, gauge_noise, gain);
        const double of_both = scale[i] * per_pressure[i] - output[COEFFICIENTS + i] / q;
        of_loads[i] = strain + of_pressure * square(per_pressure[i] * deviation);
        of_coefficients[i] = scale[i] * scale[i] * strain + of_pressure * square(of_both * deviation);
    }
}

void linear_other_noise(const Linear *linear, const double *gauge_noise, double of_pressure, double *scratch,
                        double *of_loads, double *of_coefficients) {
    const OtherLoads *other_loads = linear->other_loads;
    const size_t n = linear->map->n_gauges;
    const double *scalar = linear->inputs->value + n;
    const double q = linear->flow.pressure, deviation = linear->flow.deviation;
    for (size_t j = 0; j < other_loads->map.n_loads; j++) {
        const double length = other_loads->map.is_moment[j] > 0.0 ? scalar[REFERENCE_LENGTH] : 1.0;
        const double scale = 1.0 / (q * (scalar[REFERENCE_AREA] * length));
        const double per_pressure = scaled_other_gain(&linear->scaled, j, scratch);
        const double of_both = scale * per_pressure - other_loads->value[OTHER_COEFFICIENTS][j] / q;
        const double strain = noise_of(n, gauge_noise, scratch);
        of_loads[j] = strain + of_pressure * square(per_pressure * deviation);
        of_coefficients[j] = scale * scale * strain + of_pressure * square(of_both * deviation);
    }
}
