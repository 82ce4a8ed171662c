/* Loads in addition to the five by the linear estimator, computed when they are read.

   Value f_j, variance and df_j/dq come from the last conditioned step (scaled_form.c, scaled_other_load). The error
   of q adds to both as for the five, sigma^2 = var f + (df/dq s_q)^2 for the load and scale^2 var f + (scale df/dq
   s_q - C s_q / q)^2 for the coefficient (linear_outputs.c). NaN without identified state or q.
   docs/explanation/dynamic_pressure.md, "Weights at any dynamic pressure". */

#include "linear_other_loads.h"

#include <math.h>

#include "../update/scaled_form.h"

void linear_other_loads_update(Linear *linear) {
    OtherLoads *other_loads = linear->other_loads;
    const double *scalar = linear->inputs->value + linear->map->n_gauges;
    const int known = linear->prepared.masked->identified && linear->flow.known;
    for (size_t j = 0; j < other_loads->map.n_loads; j++) {
        double value = NAN, variance = NAN, per_pressure = NAN, scale = NAN;
        if (known) {
            const double length = other_loads->map.is_moment[j] > 0.0 ? scalar[REFERENCE_LENGTH] : 1.0;
            scaled_other_load(&linear->scaled, j, &value, &variance, &per_pressure);
            scale = 1.0 / (linear->flow.pressure * (scalar[REFERENCE_AREA] * length));
        }
        const double of_pressure = per_pressure * linear->flow.deviation, coefficient = scale * value;
        const double of_both = scale * of_pressure - coefficient * (linear->flow.deviation / linear->flow.pressure);
        other_loads->value[OTHER_LOADS][j] = value;
        other_loads->value[OTHER_LOADS_STD][j] = sqrt(variance + of_pressure * of_pressure);
        other_loads->value[OTHER_COEFFICIENTS][j] = coefficient;
        other_loads->value[OTHER_COEFFICIENTS_STD][j] = sqrt(scale * scale * variance + of_both * of_both);
    }
}
