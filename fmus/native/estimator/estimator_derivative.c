/* Derivatives of loads, coefficients and air data along a direction of the inputs, as central differences of fourth
   order.

       df = (8 (f(h) - f(-h)) - (f(2 h) - f(-2 h))) / (12 h),

   whose error is h^4 f^(5) / 30. h is STEP over the natural size of the direction: sqrt(sum (direction_i /
   size_i)^2), size_i the change of an input that moves the estimate by about its noise, so that rounding and the
   fifth derivative both stay small. Inputs that are not known do not move.

   The function that is differentiated is the estimate at which steps with the same inputs end: the track is iterated
   from the same state for each point until it moves by less than ENDED standard deviations. Where that does not
   come, or gauges or air data in use change between the points, there is no derivative. With a filter the function
   is one step from the samples before. A roll angle is differenced around the circle. The estimator is left as it
   was, to the bit. docs/developers/native.md, "States, derivatives, messages". */

#include "estimator.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#define STEP 0.002         /* of the natural size of a direction */
#define FRACTION 0.1      /* natural size of what has no noise: its value's */
#define MOST_STEPS 40
#define ENDED 1e-10       /* standard deviations of the flight state that a step moves it by, where the iterations end; */
#define NEARLY_ENDED 1e-9 /* or no longer come nearer to it, for rounding */
#define N_POINTS 4

static const double POINT[N_POINTS] = {1.0, -1.0, 2.0, -2.0}, WEIGHT[N_POINTS] = {8.0, -8.0, -1.0, 1.0};
static const double PI = 3.1415926535897931;

/* The standard deviation of a row's noise, in the unit of its reading. */
static double noise_of(const Estimator *e, size_t row) {
    const double *covariance = e->flight.present ? e->flight.map.gauge_covariance : e->map.gauge_covariance;
    const double strain = sqrt(covariance[row * (e->map.n_gauges + 1)]);
    return row < e->sensors.n_strains ? strain : strain * e->sensors.scale[row - e->sensors.n_strains];
}

/* Thrust that moves a sensor by its noise. */
static double thrust_size(const Estimator *e) {
    double size = INFINITY;
    for (size_t k = 0; k < e->sensors.count; k++) {
        const double own = noise_of(e, e->sensors.n_strains + k) / fabs(e->sensors.thrust_response[k]);
        size = own < size ? own : size;
    }
    return size;
}

/* The change of an input that moves the estimate by about its noise; 0 for one that is not known, and stays so. */
static double natural_size(const Estimator *e, size_t input) {
    const Inputs *inputs = &e->inputs;
    const size_t n = e->map.n_gauges, *first = inputs->first;
    const double value = inputs->value[input], positive = value > 0.0 ? FRACTION * value : 0.0;
    if (input < n) {
        return noise_of(e, input);
    }
    if (input == n + MOMENT_STATION) {
        return FRACTION * e->map.reference_length;
    }
    if (is_zero(inputs, input)) {
        return input - first[ZERO_RUN] < e->sensors.n_strains ? noise_of(e, input - first[ZERO_RUN]) : 0.0;
    }
    if (input == single_input(inputs, THRUST_RUN)) {
        return value == e->map.not_known ? 0.0 : thrust_size(e);
    }
    if (input >= first[PARAMETER_RUN] && input < first[PARAMETER_STD_RUN]) {
        return value == e->map.not_known ? 0.0 : FRACTION * e->parameters.span[input - first[PARAMETER_RUN]];
    }
    if (input >= first[INERTIAL_RUN]) {
        const int none = input == first[INERTIAL_RUN] + VIBRATION || value == e->map.not_known || !isfinite(value);
        return none ? 0.0 : 1.0;
    }
    const int is_temperature = input >= first[TEMPERATURE_RUN] && input < first[PARAMETER_RUN];
    return is_temperature ? (value > 0.0 ? 1.0 : 0.0) : positive;
}

/* The length of a step along the direction, in it; what stays is taken out of the direction. 0 if nothing moves. */
static double step_along(const Estimator *e, double *direction) {
    double square = 0.0;
    for (size_t i = 0; i < e->inputs.first[N_INPUT_RUNS]; i++) {
        const double size = natural_size(e, i), relative = direction[i] / size;
        direction[i] = size > 0.0 && isfinite(size) ? direction[i] : 0.0;
        square += direction[i] != 0.0 ? relative * relative : 0.0;
    }
    return square > 0.0 ? STEP / sqrt(square) : 0.0;
}

/* The outputs where steps with the present inputs end; whether they do. */
static int settle(Estimator *e, const Track *from) {
    Flight *flight = &e->flight;
    double last = INFINITY, moved = INFINITY;
    e->outdated = 1;
    estimator_outputs(e);
    if (!flight->present || estimator_filters(e)) {
        return 1;
    }
    for (int step = 0; step < MOST_STEPS && !(moved <= ENDED || (moved <= NEARLY_ENDED && moved > 0.5 * last)); step++) {
        flight->base = flight->next;
        /* Searches and the wait for the tables are held as they are: they would make the function jump. */
        flight->base.since_search = 0.0;
        flight->base.to_return = from->to_return;
        e->outdated = 1;
        estimator_outputs(e);
        last = moved;
        moved = 0.0;
        for (size_t k = 0; k < N_STATES; k++) {
            const double deviation = sqrt(flight->solver.solution.state_covariance[k * (N_STATES + 1)]);
            const double own = fabs(flight->next.state[k] - flight->base.state[k]) / deviation;
            moved = own > moved ? own : moved;
        }
    }
    return moved <= NEARLY_ENDED;
}

/* The present outputs, numbered as derivatives. */
static void copy_outputs(Estimator *e, double *value) {
    memcpy(value, e->output, sizeof e->output);
    memcpy(value + N_OUTPUTS, e->flight.real, sizeof e->flight.real);
    if (e->other_loads.present) {
        const size_t count = N_OTHER_VALUES * e->other_loads.map.n_loads;
        memcpy(value + N_OUTPUTS + N_FLIGHT_REALS, other_loads_of(e), count * sizeof *value);
    }
}

/* Add the outputs at a point, less those in the middle. */
static void add_point(Estimator *e, double weight, const double *middle, double *value, double *sum) {
    copy_outputs(e, value);
    for (size_t k = 0; k < estimator_derivatives(e); k++) {
        double apart = value[k] - middle[k];
        if (k == N_OUTPUTS + WIND_ROLL_ANGLE && fabs(apart) > PI) {
            apart -= apart > 0.0 ? 2.0 * PI : -2.0 * PI;
        }
        sum[k] += weight * apart;
    }
}

int estimator_derivative(Estimator *e, double *direction, double *derivative, char text[MODEL_TEXT_SIZE]) {
    const size_t n_inputs = e->inputs.first[N_INPUT_RUNS], count = estimator_derivatives(e);
    double *input = e->derivative_work, *middle = input + n_inputs, *value = middle + count;
    estimator_outputs(e);
    copy_outputs(e, middle);
    const unsigned char *decisions = e->flight.flag + NAVIGATION_USED;
    unsigned char decided[N_FLIGHT_FLAGS - NAVIGATION_USED];
    int settled = 1, same = 1;
    const int known = e->output[VALID_GAUGES] > 0.0;
    const Track base = e->flight.base;
    Track from = e->flight.next;
    from.since_search = 0.0;
    from.to_return = base.to_return;
    const double step = known ? step_along(e, direction) : 0.0;
    memcpy(input, e->inputs.value, n_inputs * sizeof *input);
    for (size_t k = 0; k < count; k++) {
        derivative[k] = isnan(middle[k]) || !known ? NAN : 0.0;
    }
    e->filter.may_move = 1;
    for (size_t p = 0; p < N_POINTS && step > 0.0 && settled && same; p++) {
        for (size_t i = 0; i < n_inputs; i++) {
            e->inputs.value[i] = direction[i] != 0.0 ? input[i] + POINT[p] * step * direction[i] : input[i];
        }
        if (e->flight.present && !estimator_filters(e)) {
            e->flight.base = from;
        }
        settled = settle(e, &from);
        if (p == 0) {
            memcpy(decided, decisions, sizeof decided);
        }
        same = e->output[VALID_GAUGES] == middle[VALID_GAUGES] && memcmp(decided, decisions, sizeof decided) == 0;
        add_point(e, WEIGHT[p] / (12.0 * step), middle, value, derivative);
    }
    e->filter.may_move = 0;
    memcpy(e->inputs.value, input, n_inputs * sizeof *input);
    e->flight.base = base;
    e->outdated = 1;
    if (!settled || !same) {
        snprintf(text, MODEL_TEXT_SIZE, "no derivatives: %s",
                 settled ? "gauges in use, navigation in use or the tables' loads change right beside the inputs"
                         : "the iterations do not end: the flight state lies beyond the tables");
    }
    return settled && same;
}
