/* From inputs to the sample, and from the solution to the outputs: flight.c has the formulas. */

#include "flight_derivative.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "../numerics/dual.h"
#include "../step_parts.h"
#include "flight_parts.h"

/* Changes of navigation's values and deviations. */
static void derive_navigation(const Estimator *e, const double *d_scalar, Dual value[N_NAVIGATION],
                              Dual std[N_NAVIGATION]) {
    static const unsigned char VALUES[] = {MACH_NUMBER, STATIC_PRESSURE, DYNAMIC_PRESSURE};
    static const unsigned char DEVIATIONS[] = {MACH_NUMBER_STD, STATIC_PRESSURE_STD, DYNAMIC_PRESSURE_STD};
    const Flight *flight = &e->flight;
    for (size_t k = 0; k < N_NAVIGATION; k++) {
        const double known = known_input(e, VALUES[k]), given = known_input(e, DEVIATIONS[k]);
        value[k] = dual(flight->value[k], d_scalar[VALUES[k]]);
        if (k == 1 && isnan(known)) {
            value[k].change = ambient_pressure_slope(&e->map.envelope, known_input(e, ALTITUDE)) * d_scalar[ALTITUDE];
        }
        const double own = k == 0 ? 0.0 : flight_navigation_error(e, k) * value[k].change;
        std[k] = dual(flight->std[k], isnan(given) ? own : d_scalar[DEVIATIONS[k]]);
        const double least = MIN_RELATIVE_STD * fabs(value[k].value);
        if (least == std[k].value) {
            std[k].change = MIN_RELATIVE_STD * (value[k].value < 0.0 ? -value[k].change : value[k].change);
        }
    }
}

/* That of the sample; strain holds the change of the gauges' strain. */
static void derive_sample(const Estimator *e, const double *d_input, SampleChange *change) {
    const Sample *sample = &e->flight.solver.sample;
    Dual value[N_NAVIGATION], std[N_NAVIGATION];
    derive_navigation(e, d_input + e->map.n_gauges, value, std);
    memset(change->value, 0, sizeof change->value);
    memset(change->precision, 0, sizeof change->precision);
    change->strain = d_input;
    for (size_t k = 0; k < N_NAVIGATION; k++) {
        if (sample->precision[k] > 0.0) {
            const Dual scale = k == 0 ? std[k] : dual_ratio(std[k], value[k]);
            change->value[k] = k == 0 ? value[k].change : value[k].change / value[k].value;
            change->precision[k] = -2.0 * sample->precision[k] * (scale.change / scale.value);
        }
    }
}

/* Loads and coefficients at the references and the moment point of the settings. */
static void derive_set_loads(const Estimator *e, const double *d_scalar, const SolutionChange *change,
                             double *d_output) {
    const FlightMap *map = &e->flight.map;
    const Solution *found = &e->flight.solver.solution;
    const double *scalar = e->input + e->map.n_gauges;
    const Dual area = dual(scalar[REFERENCE_AREA], d_scalar[REFERENCE_AREA]);
    const Dual length = dual(scalar[REFERENCE_LENGTH], d_scalar[REFERENCE_LENGTH]);
    const Dual shift = dual(moment_shift(e), d_scalar[MOMENT_STATION]), none = {0.0, 0.0}, one = {1.0, 0.0};
    for (size_t i = 0; i < N_LOADS; i++) {
        const Dual own = i < 3 ? area : dual_product(area, length);
        const size_t force = i < 3 ? i : i - 2, entry[2] = {i, force};
        Dual load = none, coefficient = none, variance = none, of_coefficient = none, row[2], turn[2];
        for (int a = 0; a < 2; a++) {
            const double reference = a == 0 && i >= 3 ? map->reference_area * map->reference_length : map->reference_area;
            row[a] = a == 0 ? one : i < 3 ? none : shift;
            turn[a] = dual_ratio(dual_sum(reference, row[a], 0.0, row[a]), own);
        }
        for (int a = 0; a < 2; a++) {
            const size_t j = entry[a];
            const Dual of_map = dual(found->loads[j], change->loads[j]);
            const Dual per_pressure = dual(found->coefficients[j], change->coefficients[j]);
            load = dual_sum(1.0, load, 1.0, dual_product(row[a], of_map));
            coefficient = dual_sum(1.0, coefficient, 1.0, dual_product(turn[a], per_pressure));
            for (int b = 0; b < 2; b++) {
                const size_t at = j * N_LOADS + entry[b];
                const Dual both = dual(found->load_covariance[at], change->load_covariance[at]);
                const Dual scaled = dual(found->coefficient_covariance[at], change->coefficient_covariance[at]);
                variance = dual_sum(1.0, variance, 1.0, dual_product(dual_product(row[a], both), row[b]));
                of_coefficient =
                    dual_sum(1.0, of_coefficient, 1.0, dual_product(dual_product(turn[a], scaled), turn[b]));
            }
        }
        d_output[LOADS + i] = load.change;
        d_output[COEFFICIENTS + i] = coefficient.change;
        d_output[LOADS_STD + i] = dual_root(variance).change;
        d_output[COEFFICIENTS_STD + i] = dual_root(of_coefficient).change;
    }
}

/* Deviations by which u and w leave their ranges. */
static Dual crossflow_excess(const FlightMap *map, const Dual *state, const Dual *std) {
    const double slack = 1.0 + map->range_tolerance;
    const Dual one = {1.0, 0.0};
    if (map->has_crossflow_range == 0.0) {
        const Dual u = state[STATE_U], w = state[STATE_W];
        const Dual incidence = dual_root(dual_sum(1.0, dual_product(u, u), 1.0, dual_product(w, w)));
        const Dual angle = dual_sum(1.0, incidence, -slack * map->incidence_limit, one);
        return dual_ratio(angle, dual_larger(std[STATE_U], std[STATE_W]));
    }
    Dual excess[2];
    for (size_t k = 0; k < 2; k++) {
        const Dual off = dual_sum(1.0, state[STATE_U + k], -map->crossflow_middle[k], one);
        const Dual size = dual_sum(off.value < 0.0 ? -1.0 : 1.0, off, -slack * map->crossflow_half[k], one);
        excess[k] = dual_ratio(size, std[STATE_U + k]);
    }
    return dual_larger(excess[0], excess[1]);
}

/* Of the deviations by which the flight state leaves the ranges of the map. */
static double derive_range_score(const Flight *flight, const SolutionChange *change) {
    const FlightMap *map = &flight->map;
    const Solution *found = &flight->solver.solution;
    const double tolerance = map->range_tolerance;
    Dual state[N_STATES], std[N_STATES];
    for (size_t k = 0; k < N_STATES; k++) {
        const size_t at = k * N_STATES + k;
        state[k] = dual(found->state[k], change->state[k]);
        std[k] = dual_root(dual(found->state_covariance[at], change->state_covariance[at]));
    }
    const Dual one = {1.0, 0.0}, none = {0.0, 0.0};
    const Dual mach =
        dual_larger(dual_sum(map->mach_range[0] * (1.0 - tolerance), one, -1.0, state[STATE_MACH]),
                    dual_sum(1.0, state[STATE_MACH], -map->mach_range[1] * (1.0 + tolerance), one));
    const Dual pressure = dual_larger(dual_sum(map->log_pressure_range[0], one, -1.0, state[STATE_PRESSURE]),
                                      dual_sum(1.0, state[STATE_PRESSURE], -map->log_pressure_range[1], one));
    const Dual score = dual_larger(dual_ratio(mach, std[STATE_MACH]), crossflow_excess(map, state, std));
    return dual_larger(dual_larger(score, dual_ratio(pressure, std[STATE_PRESSURE])), none).change;
}

/* Whether navigation that was dropped widened the deviations of the others: by a residual of the step itself, of which
   the end of the iterations says nothing. */
static int navigation_doubted(const Flight *flight) {
    const double *residual = flight->solver.solution.navigation_residual, *precision = flight->solver.sample.precision;
    int doubted = 0;
    for (size_t k = 0; k < N_NAVIGATION; k++) {
        const int dropped = !(precision[k] > 0.0) && fabs(residual[k]) > 0.0;
        for (size_t i = 0; i < N_NAVIGATION; i++) {
            doubted |= dropped && i != k && navigation_may_be_wrong(flight, residual[k], residual[i]);
        }
    }
    return doubted;
}

/* Whether a direction moves a parameter of the flow that is known with a deviation, or that. */
static int moves_known(const Estimator *e, const double *d_input) {
    int moves = 0;
    for (size_t k = 0; k < e->parameters.count; k++) {
        moves |= parameter_known(e, k)
              && (d_input[first_parameter(e) + k] != 0.0 || d_input[first_parameter_std(e) + k] != 0.0);
    }
    return moves;
}

static const char *why_none(const Estimator *e, const double *d_input) {
    const Flight *flight = &e->flight;
    return flight_filters(e) ? "the filter over time is on"
         : flight->flag[LINEAR_LOADS] ? "strain does not fit, the loads are those of the linear map"
         : moves_known(e, d_input) ? "a parameter of the flow is among the inputs, and stated with its deviation"
         : navigation_doubted(flight) ? "navigation is inconsistent, and the rest of it counts less for that"
                                      : NULL;
}

/* Deviations that hold other flight states as well have none, and neither has the score that is in them. */
static void leave_out_deviations(const Estimator *e, double *d_output) {
    const size_t m = e->further.map.n_loads;
    double *d_further = d_output + N_DERIVATIVES;
    for (size_t i = 0; i < N_LOADS; i++) {
        d_output[LOADS_STD + i] = d_output[COEFFICIENTS_STD + i] = NAN;
    }
    for (size_t i = 0; i < N_AIR_DATA; i++) {
        d_output[N_OUTPUTS + N_AIR_DATA + i] = NAN;
    }
    for (size_t j = 0; j < m; j++) {
        d_further[FURTHER_LOADS_STD * m + j] = d_further[FURTHER_COEFFICIENTS_STD * m + j] = NAN;
    }
    d_output[ENVELOPE_SCORE] = e->output[ENVELOPE_SCORE] > 0.0 ? NAN : 0.0;
}

int flight_derivative(Estimator *e, const double *d_input, double *d_output, char text[MODEL_TEXT_SIZE]) {
    Flight *flight = &e->flight;
    const double *d_scalar = d_input + e->map.n_gauges;
    const double d_alarm = d_scalar[ALARM_SCALE];
    SampleChange sample;
    SolutionChange change;
    if (e->output[VALID_GAUGES] == 0.0 && !flight_filters(e)) {
        set_unknown(d_output);
        for (size_t k = N_OUTPUTS; k < zero_derivative(e, 0); k++) {
            d_output[k] = NAN;
        }
        return 1;
    }
    const char *reason = why_none(e, d_input);
    if (reason == NULL) {
        if (flight->tangents.outdated) {
            tangents_prepare(&flight->solver, &flight->tangents);
            further_tangents_prepare(flight);
        }
        reason = flight->tangents.ended ? NULL : "the iterations have not ended: the flight state moves fast, or lies "
                                                 "beyond the tables";
    }
    if (reason != NULL) {
        snprintf(text, MODEL_TEXT_SIZE, "no derivatives: %s", reason);
        return 0;
    }
    derive_sample(e, d_input, &sample);
    tangents_along(&flight->solver, &flight->tangents, &sample, &change);
    derive_set_loads(e, d_scalar, &change, d_output);
    derive_air_data(flight, &change, d_output + N_OUTPUTS);
    derive_further(e, d_input, &change, d_output + N_DERIVATIVES);
    d_output[CHI_SQUARE] = change.chi_square;
    if (d_alarm != 0.0) { /* the limit may be infinite */
        d_output[CHI_SQUARE_LIMIT] = e->output[CHI_SQUARE_LIMIT] / e->input[e->map.n_gauges + ALARM_SCALE] * d_alarm;
    }
    d_output[ENVELOPE_SCORE] = derive_range_score(flight, &change);
    if (flight->solver.solution.widening[0] != 0.0) {
        leave_out_deviations(e, d_output);
    }
    return 1;
}
