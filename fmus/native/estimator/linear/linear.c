/* The linear estimator: the flow of a sample, whether it is inside what the map covers, and outputs from the
   conditioned loads.

   Strain gives loads only with a dynamic pressure q and its standard deviation: stated, the map's, or, where q is
   computed from M and a pressure, by its sources (sample/inputs.c). Then scaled_form.c conditions the loads
   (linear_outputs.c).

   Measured angles may contradict the lateral coefficients. Lateral force rises by at most 1 / incidence_per_force
   with incidence, so that the coefficients c = (C_N, C_Y) need at least the incidence a = k |c| in their direction e
   = c / |c|, k = 0.8 incidence_per_force (curves over Mach number and roll angle differ). With measured angles v =
   (u, w) of variances 1 / p they contradict where

       a - e' v > 0     and     (a - e' v)^2 > limit * sum over known angles of e_k^2 (1 / p_k + (k sigma_ck)^2).

   A measured incidence above a is none: what is stated is a minimum.

   The flow is outside where q, M or h leave their ranges (M by three stated standard deviations), or where M and h
   contradict q: |q - gamma/2 M^2 p(h)| > tolerance of it + three standard deviations of q. docs/explanation/dynamic_pressure.md;
   docs/explanation/envelope.md, "What is compared"; strainfmu/estimator/reference/linear.py. */

#include "linear.h"

#include <math.h>
#include <string.h>

/* Arrays of every step come first: they are aligned as the block is. */
void linear_arrays(Map *map, size_t n_strains, Linear *linear, Room *room) {
    linear->prepared.noise.wide = linear->wide;
    linear->prepared.noise.other_loads = linear->scaled.other_loads = linear->other_loads;
    linear->scaled.map = map;
    linear->scaled.n_loads = N_LOADS + linear->other_loads->map.n_loads;
    linear->scaled.wide = linear->wide;
    linear->prepared.scaled = &linear->scaled;
    scaled_arrays(&linear->scaled, room);
    half_space_arrays(&map->envelope, linear, room);
    prepared_arrays(map, n_strains, &linear->prepared, room);
}

/* What follows from the matrices of the map. */
static void follow_matrices(Linear *linear) {
    if (linear->map->has_low_rank) {
        low_rank_renew(&linear->scaled, linear->prepared.n_strains, linear->prepared.noise_std);
    } else {
        scaled_prepare(&linear->scaled);
    }
}

int linear_begin(Linear *linear) {
    const int good = prepared_begin(&linear->prepared);
    if (good && linear->map->has_low_rank) {
        low_rank_prepare(&linear->scaled);
    }
    if (good) {
        follow_matrices(linear);
    }
    return good;
}

void linear_renewed(Linear *linear) {
    prepared_renewed(&linear->prepared);
    follow_matrices(linear);
}

/* Of the smallest incidence per lateral force over that at the largest incidence: curves over Mach number and roll angle
   differ. */
#define LEAST_PART_OF_SLOPE 0.8

/* The standard deviation of q: stated or the map's; where q is computed, by its sources. */
static double pressure_deviation(const Linear *linear, double pressure) {
    const Inputs *inputs = linear->inputs;
    const double given = known_input(inputs, DYNAMIC_PRESSURE_STD), stated_mach = known_input(inputs, MACH_NUMBER_STD);
    const double deviation = isnan(given) ? linear->map->dynamic_pressure_error * pressure : given;
    const double mach = known_input(inputs, MACH_NUMBER), known = isnan(mach) ? 1.0 : mach;
    if (isnan(mach) && !(known_of(inputs, LAST_RUN, Q_SOURCE) > 0.5)) { /* without M nothing is computed */
        return deviation;
    }
    const double mach_std = isnan(stated_mach) || isnan(mach) ? DAY_OF_MACH * known : stated_mach;
    const double relative = known_input(inputs, STATIC_PRESSURE_STD) / known_input(inputs, STATIC_PRESSURE);
    const double pressure_std = isnan(relative) ? DAY_OF_PRESSURE : relative;
    const PressureSource source = pressure_source(inputs);
    if (source == INDEPENDENT) {
        return deviation;
    }
    const double of_pressure = source == MACH_AND_ALTITUDE ? DAY_OF_ALTITUDE : pressure_std;
    return computed_pressure_std(inputs, given, pressure * computed_pressure_error(known, mach_std, of_pressure));
}

/* Flow and air data of the inputs; coefficients are known where q lies in its range and its error is a number. */
static Flow flow_of(const Linear *linear) {
    const double pressure = scalar_input(linear->inputs, DYNAMIC_PRESSURE);
    const double mach_std = known_input(linear->inputs, MACH_NUMBER_STD);
    Flow flow = {.pressure = pressure,
                 .mach_number = known_input(linear->inputs, MACH_NUMBER),
                 .altitude = known_input(linear->inputs, ALTITUDE),
                 .mach_deviation = isnan(mach_std) ? 0.0 : mach_std};
    if (!(pressure >= linear->map->min_dynamic_pressure && pressure <= linear->map->max_dynamic_pressure)) {
        return flow;
    }
    const double deviation = pressure_deviation(linear, pressure);
    flow.known = deviation >= 0.0 && deviation < INFINITY;
    flow.deviation = flow.known ? deviation : 0.0;
    return flow;
}

/* Whether the flow comes from another side by measured angles than by lateral forces: see the head of this file. */
static int angles_contradict(const Linear *linear) {
    const Map *map = linear->map;
    MeasuredAngles angles;
    measured_angles(linear->inputs, &angles);
    if (angles.count == 0 || !(map->incidence_per_force > 0.0)) {
        return 0;
    }
    const double area = scalar_input(linear->inputs, REFERENCE_AREA) / map->reference_area;
    const double slope = LEAST_PART_OF_SLOPE * map->incidence_per_force * area;
    double square = 0.0, along = 0.0, variance = 0.0;
    for (size_t k = 0; k < 2; k++) {
        const double force = angles.precision[k] > 0.0 ? slope * linear->output[COEFFICIENTS + 1 + k] : 0.0;
        square += force * force;
        along += force * angles.value[k];
    }
    const double needed = sqrt(square);
    for (size_t k = 0; k < 2 && needed > 0.0; k++) {
        const double part = slope * linear->output[COEFFICIENTS + 1 + k] / needed;
        const double of_force = slope * linear->output[COEFFICIENTS_STD + 1 + k];
        variance += angles.precision[k] > 0.0 ? part * part * (1.0 / angles.precision[k] + of_force * of_force) : 0.0;
    }
    /* a - e' v; an angle that is not known has neither force nor value here. */
    const double apart = needed > 0.0 ? needed - along / needed : 0.0;
    const double limit = scalar_input(linear->inputs, ALARM_SCALE) * map->chi_square_limit[0];
    return apart > 0.0 && apart * apart > limit * variance;
}

#define RANGE_DEVIATIONS 3.0 /* of a stated Mach number by which it may leave its range, and of q_inf */

/* Whether a value leaves a range by more than so much; one that is not known does not. */
static int leaves(const double *range, double value, double slack) {
    return value < range[0] - slack || value > range[1] + slack;
}

/* Whether dynamic pressure, Mach number or altitude leave their ranges or contradict each other. */
static int outside_by_navigation(const Envelope *envelope, const Flow *flow) {
    const double mach = flow->mach_number;
    if (leaves(envelope->dynamic_pressure, flow->pressure, 0.0)
        || leaves(envelope->mach_number, mach, RANGE_DEVIATIONS * flow->mach_deviation)
        || leaves(envelope->altitude, flow->altitude, 0.0)) {
        return 1;
    }
    /* Without both nothing contradicts q. */
    if (isnan(mach) || isnan(flow->altitude)) {
        return 0;
    }
    const double expected = envelope->half_gamma * mach * mach * ambient_pressure(envelope, flow->altitude);
    const double allowed = envelope->pressure_tolerance * expected + RANGE_DEVIATIONS * flow->deviation;
    return fabs(flow->pressure - expected) > allowed;
}

/* Bits of sample.h. Without a dynamic pressure the other conditions mean nothing. */
static int conditions_of(const Linear *linear) {
    const double *output = linear->output;
    const Envelope *envelope = &linear->map->envelope;
    if (!linear->flow.known) {
        return PRESSURE_UNKNOWN;
    }
    const int outside = outside_by_navigation(envelope, &linear->flow) || parameter_beyond(linear->inputs) != SIZE_MAX;
    return (outside ? FLOW_OUTSIDE : 0) | (output[CHI_SQUARE] > output[CHI_SQUARE_LIMIT] ? STRAIN_MISFIT : 0)
         | (angles_contradict(linear) ? ANGLES_CONTRADICT : 0) | (output[SUSPECTS] > 0.0 ? GAUGE_MISFIT : 0)
         | (output[ENVELOPE_SCORE] > envelope->score_limit ? COEFFICIENTS_OUTSIDE : 0)
         | (linear->prepared.masked->n_used < linear->map->n_gauges ? GAUGES_LOST : 0);
}

/* Without an estimate; the limit of chi-square is that of all gauges. */
static void set_nothing_known(Linear *linear) {
    const Map *map = linear->map;
    const double limit = map->chi_square_scale * map->chi_square_limit[map->degrees_of_freedom - 1];
    set_unknown(linear->output, limit * scalar_input(linear->inputs, ALARM_SCALE));
}

void linear_update(Linear *linear) {
    double *output = linear->output;
    prepared_follow(&linear->prepared, linear->inputs);
    const MaskedMap *m = linear->prepared.masked;
    output[VALID_GAUGES] = (double)m->n_used;
    output[SUSPECT_GAUGE] = output[SUSPECTS] = 0.0;
    if (!m->identified) {
        set_nothing_known(linear);
        linear->conditions = m->n_used > 0 ? NOT_IDENTIFIED : NO_GAUGE;
        return;
    }
    linear->flow = flow_of(linear);
    if (linear->flow.known || !linear->map->form.follows_pressure) {
        linear_outputs(linear);
    } else {
        set_nothing_known(linear);
    }
    linear->conditions = conditions_of(linear);
}

/* Loads for the nonlinear estimator where the tables do not fit. Health and counts are not the linear map's then:
   these outputs are restored, and all of them where it has no loads. */
int linear_loads_at(Linear *linear, double dynamic_pressure, double deviation) {
    double kept[N_OUTPUTS];
    memcpy(kept, linear->output, sizeof kept);
    prepared_follow(&linear->prepared, linear->inputs);
    const MaskedMap *m = linear->prepared.masked;
    Flow flow = {.pressure = dynamic_pressure, .deviation = deviation, .mach_number = NAN, .altitude = NAN};
    flow.known = dynamic_pressure >= linear->map->min_dynamic_pressure
              && dynamic_pressure <= linear->map->max_dynamic_pressure && deviation >= 0.0 && deviation < INFINITY;
    linear->flow = flow;
    int found = m->identified && linear->flow.known;
    if (found) {
        linear_outputs(linear);
    }
    for (int i = 0; i < N_LOADS; i++) {
        found = found && isfinite(linear->output[COEFFICIENTS + i]);
    }
    const size_t first = found ? HEALTH_STATE : 0;
    memcpy(linear->output + first, kept + first, (N_OUTPUTS - first) * sizeof *kept);
    return found;
}
