/* Variables by number: which input, output or flag a number stands for, in FMI 2.0 one by one and in FMI 3.0 as
   arrays.

       outputs (27) | readings (n) | valid (n) | scalars | of maps with tables: air data, real outputs, flags | zero offsets |
       temperatures, thrust, time constant | other loads | tare | parameters, scores, standard deviations | later air data |
       last air data | health.usable | inertial unit

   Runs that a map does not have are empty, and later runs move up. Numbers are compared as `number - first < count`
   in size_t: a number below `first` wraps round to a large one, so that one comparison tests both ends.
   docs/developers/native.md, "Variables"; strainfmu/interface/estimator_variables.py lists the same for
   modelDescription.xml. */

#include "estimator_variables.h"

#define LINEAR_REFERENCES 24u /* arrays of FMI 3.0 of a map without tables and other sensors; time follows them */
#define FLIGHT_REFERENCES (N_NAVIGATION_INPUTS + N_FLIGHT_REALS + N_FLIGHT_FLAGS)
#define ZERO_REFERENCES 3u   /* zero, zero_std, zero_common_std */
#define TARE_REFERENCES 5u   /* tare, tare_state, zero_in_use, zero_in_use_std, zero_in_use_common_std */

/* Number of the first of the zeros. */
static size_t first_zero(const Estimator *e) {
    return N_OUTPUTS + 2 * e->map.n_gauges + N_SCALAR_INPUTS + (e->flight.present ? FLIGHT_REFERENCES : 0);
}

/* Value reference of FMI 3.0 of the first of the zeros. */
static unsigned zero_reference(const Estimator *e) {
    return LINEAR_REFERENCES + (unsigned)e->sensors.count + (e->flight.present ? FLIGHT_REFERENCES : 0);
}

static int has_temperatures(const Estimator *e) {
    return e->inputs.n_temperatures > 0;
}

/* Value reference of FMI 3.0 of the first of thrust and the time constant of the filter. */
static unsigned thrust_reference(const Estimator *e) {
    return zero_reference(e) + ZERO_REFERENCES + (unsigned)has_temperatures(e);
}

/* Value reference of FMI 3.0 of the first of the other loads. */
static unsigned other_reference(const Estimator *e) {
    return thrust_reference(e) + (unsigned)e->sensors.has_thrust + (unsigned)(filter_setting(&e->inputs) != SIZE_MAX);
}

/* Value reference of FMI 3.0 of the input of the tare. */
static unsigned tare_reference(const Estimator *e) {
    return other_reference(e) + (unsigned)e->other_loads.map.n_arrays;
}

/* Value reference of FMI 3.0 of the first parameter of the flow; their scores, then their standard deviations follow. */
static unsigned parameter_reference(const Estimator *e) {
    return tare_reference(e) + (e->tare.present ? TARE_REFERENCES : 0);
}

/* Number of variables of parameters of the flow. */
static size_t n_of_parameters(const Estimator *e) {
    return (e->flight.known.present ? 3 : 2) * e->parameters.count;
}

/* Number of variables of LATER_INPUTS; LAST_INPUTS, health.usable and INERTIAL_INPUTS follow. */
static size_t n_later(const Estimator *e) {
    return e->flight.present ? N_LATER_INPUTS : 0;
}

unsigned time_reference(const Estimator *e) {
    return parameter_reference(e) + (unsigned)(n_of_parameters(e) + n_later(e) + N_LAST_INPUTS + 1 + e->inputs.n_inertial);
}

/* Number of the first of the other loads. */
static size_t first_other(const Estimator *e) {
    return first_zero(e) + first_parameter(&e->inputs) - (e->map.n_gauges + N_ALL_SCALARS);
}

size_t tare_variable(const Estimator *e) {
    return first_other(e) + e->other_loads.n_outputs;
}

size_t zero_in_use(const Estimator *e, size_t variable) {
    const size_t number = variable - (tare_variable(e) + 2);
    return e->tare.present && number < number_of_zeros(e->sensors.n_strains) ? number : SIZE_MAX;
}

/* Number of the first parameter of the flow; their scores, then their standard deviations follow. */
static size_t first_parameter_variable(const Estimator *e) {
    return tare_variable(e) + (e->tare.present ? 2 + number_of_zeros(e->sensors.n_strains) : 0);
}

size_t usable_variable(const Estimator *e) {
    return first_parameter_variable(e) + n_of_parameters(e) + n_later(e) + N_LAST_INPUTS;
}

size_t parameter_output(const Estimator *e, size_t variable) {
    const size_t which = variable - first_parameter_variable(e) - e->parameters.count;
    return which < e->parameters.count ? which : SIZE_MAX;
}

const double *other_real(const Estimator *e, size_t variable) {
    const size_t number = variable - first_other(e); /* size_t: what is ahead of them wraps round */
    return number < e->other_loads.n_outputs ? e->other_loads.value[0] + e->other_loads.output[number] : NULL;
}

/* Number of a variable among the nonlinear estimator's; SIZE_MAX for any other. */
static size_t flight_variable(const Estimator *e, size_t variable) {
    const size_t number = variable - (N_OUTPUTS + 2 * e->map.n_gauges + N_SCALAR_INPUTS);
    return e->flight.present && number < FLIGHT_REFERENCES ? number : SIZE_MAX;
}

size_t flight_real(const Estimator *e, size_t variable) {
    const size_t number = flight_variable(e, variable) - N_NAVIGATION_INPUTS;
    return number < N_FLIGHT_REALS ? number : SIZE_MAX;
}

size_t flight_flag(const Estimator *e, size_t variable) {
    const size_t number = flight_variable(e, variable) - (N_NAVIGATION_INPUTS + N_FLIGHT_REALS);
    return number < N_FLIGHT_FLAGS ? number : SIZE_MAX;
}

int is_real_output(size_t variable) {
    return variable < HEALTH_STATE || variable == CHI_SQUARE || variable == CHI_SQUARE_LIMIT
        || variable == ENVELOPE_SCORE;
}

int is_source(const Estimator *e, size_t variable) {
    return input_of(e, variable) == first_last(&e->inputs) + Q_SOURCE;
}

size_t input_of(const Estimator *e, size_t variable) {
    const size_t n = e->map.n_gauges;
    if (variable - N_OUTPUTS < n) { /* size_t: outputs wrap round to large numbers */
        return variable - N_OUTPUTS;
    }
    const size_t scalar = variable - (N_OUTPUTS + 2 * n), zero = variable - first_zero(e);
    if (zero < first_parameter(&e->inputs) - (n + N_ALL_SCALARS)) { /* zeros, then temperatures, thrust, the filter's */
        return n + N_ALL_SCALARS + zero;
    }
    const size_t parameter = variable - first_parameter_variable(e), count = e->parameters.count;
    if (parameter < count) {
        return first_parameter(&e->inputs) + parameter;
    }
    if (e->flight.known.present && parameter - 2 * count < count) {
        return first_parameter_std(&e->inputs) + (parameter - 2 * count);
    }
    const size_t later = parameter - n_of_parameters(e);
    if (later < n_later(e)) {
        return first_later(&e->inputs) + later;
    }
    if (later - n_later(e) < N_LAST_INPUTS) {
        return first_last(&e->inputs) + (later - n_later(e));
    }
    if (variable - (usable_variable(e) + 1) < e->inputs.n_inertial) {
        return first_inertial(&e->inputs) + (variable - (usable_variable(e) + 1));
    }
    return scalar < (e->flight.present ? N_ALL_SCALARS : N_SCALAR_INPUTS) ? n + scalar : SIZE_MAX;
}

Type model_type_of(const Model *model, size_t variable) {
    const Estimator *e = estimator_of(model);
    if (is_source(e, variable)) {
        return ENUMERATION;
    }
    if (is_real_output(variable) || input_of(e, variable) != SIZE_MAX || flight_real(e, variable) != SIZE_MAX
        || other_real(e, variable) != NULL || zero_in_use(e, variable) != SIZE_MAX
        || parameter_output(e, variable) != SIZE_MAX) {
        return REAL;
    }
    if (e->tare.present && variable - tare_variable(e) < 2) {
        return variable == tare_variable(e) ? BOOLEAN : ENUMERATION;
    }
    if (variable < N_OUTPUTS) {
        return variable == HEALTH_STATE ? ENUMERATION : INTEGER;
    }
    if (variable == usable_variable(e)) {
        return BOOLEAN;
    }
    const int flag = variable - (N_OUTPUTS + e->map.n_gauges) < e->map.n_gauges || flight_flag(e, variable) != SIZE_MAX;
    return flag ? BOOLEAN : NO_VARIABLE;
}

/* The flag, the state, then the zeros in use as the inputs have them. */
static Selection tare_array(const Estimator *e, size_t which) {
    const size_t n = e->sensors.n_strains;
    const size_t first = tare_variable(e) + (which < 2 ? which : 2 + (which - 2) * n);
    return (Selection){NULL, first, which == 2 || which == 3 ? n : 1};
}

/* Zeros, their standard deviations, the common one, then temperatures, then scalars. */
static Selection input_array(const Estimator *e, unsigned reference) {
    const size_t n = e->sensors.n_strains, which = reference - zero_reference(e), first = first_zero(e);
    if (which < ZERO_REFERENCES) {
        return (Selection){NULL, first + which * n, which < 2 ? n : 1};
    }
    const size_t n_temperatures = e->inputs.n_temperatures;
    const size_t temperatures = first + number_of_zeros(n);
    if (reference < thrust_reference(e)) {
        return (Selection){NULL, temperatures, n_temperatures};
    }
    return (Selection){NULL, temperatures + n_temperatures + (reference - thrust_reference(e)), 1};
}

static Selection other_array(const Estimator *e, size_t which) {
    const OtherLoads *loads = &e->other_loads;
    return (Selection){NULL, first_other(e) + loads->array_start[which], (size_t)loads->map.array_size[which]};
}

/* Each array follows the one before it without a gap. */
Selection model_array(const Model *model, unsigned reference) {
    static const unsigned char FIRST[] = {
        0,  5,                      /* coefficients, sigma_coefficients */
        10, 13, 15, 18,             /* forces, moments, sigma_forces, sigma_moments */
        20, 21, 22, 23, 24, 25, 26, /* health.state, .chi_square, .chi_square_limit, .valid_gauges, ... */
        N_OUTPUTS,                  /* strain; other sensors; valid, then scalar inputs and settings */
    };
    const Estimator *e = estimator_of(model);
    const size_t n = e->map.n_gauges, n_strains = e->sensors.n_strains, strain = sizeof FIRST - 1;
    const size_t valid = strain + 1 + e->sensors.count;
    if (reference >= model->time_reference) {
        return (Selection){NULL, 0, 0};
    }
    if (reference < strain) {
        return (Selection){NULL, FIRST[reference], (size_t)(FIRST[reference + 1] - FIRST[reference])};
    }
    if (reference < valid) {
        const size_t which = reference - strain; /* 0 for the strains */
        return (Selection){NULL, N_OUTPUTS + (which ? n_strains + which - 1 : 0), which ? 1 : n_strains};
    }
    if (reference < zero_reference(e)) {
        const size_t which = reference - valid;
        return (Selection){NULL, N_OUTPUTS + n + (which ? n + which - 1 : 0), which ? 1 : n};
    }
    if (reference >= parameter_reference(e)) {
        return (Selection){NULL, first_parameter_variable(e) + (reference - parameter_reference(e)), 1};
    }
    if (reference >= tare_reference(e)) {
        return tare_array(e, reference - tare_reference(e));
    }
    return reference >= other_reference(e) ? other_array(e, reference - other_reference(e))
                                             : input_array(e, reference);
}
