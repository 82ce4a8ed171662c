#include <math.h>
#include <stdio.h>

#include "linear/absolute_form.h"
#include "linear/scaled_form.h"
#include "manifold/flight_derivative.h"
#include "step_parts.h"

/* Changes of the strains that the map sees, in place of those of the readings. */
static void derive_strain(Estimator *e, double *d_input) {
    const SensorRows *rows = &e->sensors;
    const double *d_zero = d_input + e->map.n_gauges + N_ALL_SCALARS;
    const int of_input = zeros_in_use(e) == e->input + e->map.n_gauges + N_ALL_SCALARS; /* not of a tare */
    const double d_thrust = rows->has_thrust ? d_input[thrust_input(e)] : 0.0;
    for (size_t i = 0; i < rows->n_strains; i++) {
        d_input[i] -= of_input ? d_zero[i] : 0.0;
    }
    for (size_t k = 0; k < rows->count; k++) {
        double *d_reading = d_input + rows->n_strains + k;
        *d_reading = without_thrust(rows, k, *d_reading, d_thrust) / rows->scale[k];
    }
    if (e->thermal.present) {
        estimator_set_strain(e);
        thermal_derive(&e->thermal, e->strain, d_input + first_temperature(e), d_input);
        thermal_correct(&e->thermal, e->strain);
    }
}

/* Those of further loads end here; zeros in use and scores of parameters follow. */
static size_t first_simple(const Estimator *e) {
    return N_DERIVATIVES + N_FURTHER * e->further.map.n_loads;
}

static size_t number_in_use(const Estimator *e) {
    return 2 * e->sensors.n_strains + 1;
}

size_t estimator_derivatives(const Estimator *e) {
    return first_simple(e) + number_in_use(e) + e->parameters.count;
}

size_t zero_derivative(const Estimator *e, size_t zero) {
    return first_simple(e) + zero;
}

size_t score_derivative(const Estimator *e, size_t parameter) {
    return first_simple(e) + number_in_use(e) + parameter;
}

/* Of outputs that follow from one input each. */
static void derive_simple(const Estimator *e, const double *d_input, double *d_output) {
    const size_t first = e->map.n_gauges + N_ALL_SCALARS;
    const FlowParameters *parameters = &e->parameters;
    if (zeros_in_use(e) == e->input + first) {
        memcpy(d_output + zero_derivative(e, 0), d_input + first, number_in_use(e) * sizeof *d_output);
    }
    for (size_t k = 0; k < parameters->count; k++) {
        const double given = e->input[first_parameter(e) + k], d_given = d_input[first_parameter(e) + k];
        const int moves = given != e->map.not_known && parameter_score(parameters, k, given) < parameters->largest_score;
        const double sign = given < parameters->minimum[k] ? -1.0 : given > parameters->maximum[k] ? 1.0 : 0.0;
        d_output[score_derivative(e, k)] = moves ? sign * (d_given / parameters->span[k]) : 0.0;
    }
}

int estimator_derivative(Estimator *e, double *d_input, double *d_output, char text[MODEL_TEXT_SIZE]) {
    estimator_outputs(e);
    if (linear_filters(e) && e->linear_filter.base.has_law != 0.0) {
        snprintf(text, MODEL_TEXT_SIZE, "no derivatives: the filter over time is on");
        return 0;
    }
    memset(d_output, 0, estimator_derivatives(e) * sizeof *d_output);
    derive_simple(e, d_input, d_output);
    derive_strain(e, d_input);
    if (e->flight.present) {
        return flight_derivative(e, d_input, d_output, text);
    }
    if (e->further.present && !(e->masked->identified && e->flow.known)) {
        for (size_t k = N_DERIVATIVES; k < first_simple(e); k++) {
            d_output[k] = NAN;
        }
    }
    if (!e->masked->identified) {
        set_unknown(d_output);
        return 1;
    }
    if (!e->map.scaled) {
        absolute_derivative(e, d_input, d_output);
    } else if (e->flow.known) {
        scaled_derivative(e, d_input, d_output);
    } else {
        set_unknown(d_output);
    }
    return 1;
}
