#include "flight_filter.h"

#include <math.h>

#include "../../core/elementary.h"
#include "../filter/filter.h"
#include "../filter/filter_known.h"
#include "../filter/filter_sample.h"
#include "../filter/predict.h"
#include "../nonlinear/flight_sample.h"
#include "../nonlinear/flight_search.h"
#include "../sample/readings.h"
#include "air_data_faults.h"
#include "consistency.h"
#include "fall_back.h"
#include "flight_outputs.h"
#include "named_navigation.h"

#define NOTICED 3.0 /* deviations of a rate at which half of the motion counts: flight_track.py */

/* What was doubted counts with its deviation, and errs more. */
static void set_doubt(Filter *filter, const double *before) {
    double *precision = filter->solver->sample.precision;
    for (size_t k = 0; k < N_NAVIGATION; k++) {
        if (precision[k] > 0.0) {
            filter->doubt[k] = before[k] / precision[k];
            precision[k] = before[k];
        }
    }
}

/* Solve from a law, a second time without navigation that is inconsistent; slopes as of filter_sample. */
static void solve(Flight *flight, const Law *law, const double *start, size_t iterations, const double *slopes) {
    Filter *filter = &flight->filter;
    double residual[N_NAVIGATION], before[N_NAVIGATION];
    memcpy(before, flight->solver.sample.precision, sizeof before);
    for (size_t k = 0; k < N_NAVIGATION; k++) {
        filter->doubt[k] = 1.0;
    }
    filter_sample(filter, law, start, iterations, slopes);
    memcpy(residual, flight->solver.solution.navigation_residual, sizeof residual);
    if (flight_drop_inconsistent(flight)) {
        set_doubt(filter, before);
        filter_sample(filter, law, start, (size_t)flight->map.warm_iterations, slopes);
    }
    filter_judge(filter, residual);
    memcpy(flight->solver.solution.navigation_residual, residual, sizeof residual);
}

/* What navigation and the ranges of the map say, without what is apart. */
static void measure(Flight *flight) {
    flight_set_measurement(&flight->solver, flight->navigation.value, flight->navigation.std);
    filter_leave_out_named(&flight->filter);
}

/* Write the solution to the outputs, not OK while navigation that is given is named; whether it fits. */
static int conclude(Flight *flight, size_t used) {
    const Filter *filter = &flight->filter;
    const int fits = flight_conclude(flight, used);
    for (size_t k = 0; k < N_NAVIGATION; k++) {
        if (filter->next.apart[k] > 0.0 && filter->given[k] > 0.0 && flight->output[HEALTH_STATE] == (double)OK) {
            flight->output[HEALTH_STATE] = DEGRADED;
        }
    }
    return fits;
}

/* Let the next step go on from the flight state of these slopes, NULL for that which it starts from, of an age [s]. */
static void keep_slopes(Flight *flight, const double *slopes, double age) {
    FilterTrack *next = &flight->filter.next;
    memcpy(next->slope_state, slopes == NULL ? flight->next.state : slopes, sizeof next->slope_state);
    next->slope_age = age;
}

static void note(Flight *flight, size_t used) {
    const double freedom = (double)(used + flight_navigation_used(flight));
    filter_note(&flight->filter, flight->solver.solution.chi_square,
                scalar_input(flight->inputs, ALARM_SCALE) * freedom);
}

/* Keep what a sample that fits leaves, and slopes of an age. */
static void keep(Flight *flight, size_t used, int searched, const double *slopes, double age) {
    const double to_return = flight_waiting(flight);
    flight->next = (Track){.has_state = 1.0,
                           .since_search = flight_since_search(flight, searched),
                           .to_return = to_return};
    memcpy(flight->next.state, flight->solver.solution.state, sizeof flight->next.state);
    keep_slopes(flight, slopes, age);
    flight->filter.next.has_law = 1.0;
    note(flight, used);
    flight_fall_back(flight, 1, to_return);
}

/* Let the predicted law, if there is one, go on to the next step. */
static void keep_predicted(Filter *filter, int has_law) {
    if (has_law) {
        laws_move_cross(&filter->laws);
    }
    filter->next.has_law = has_law;
    laws_keep_predicted(&filter->laws);
}

/* The sample on its own; the filter begins again from it if it fits. */
static void begin(Flight *flight, size_t used, int has_law) {
    const Track *base = &flight->base;
    double start[N_STATES];
    measure(flight);
    flight_solve_cold(&flight->solver);
    memcpy(start, flight->solver.solution.state, sizeof start);
    solve(flight, &flight->filter.laws.stationary, start, 0, NULL);
    if (conclude(flight, used)) {
        keep(flight, used, 1, NULL, 0.0);
        return;
    }
    flight->next = (Track){.has_state = 1.0, .since_search = 0.0, .to_return = flight->map.return_after};
    /* What fits nowhere does not move the state: the law goes on from there. */
    const double *state = base->has_state != 0.0 ? base->state : flight->solver.solution.state;
    memcpy(flight->next.state, state, sizeof flight->next.state);
    keep_slopes(flight, NULL, 0.0);
    filter_keep_named(&flight->filter);
    keep_predicted(&flight->filter, has_law);
    note(flight, used);
    flight_fall_back(flight, 0, flight->map.return_after);
}

/* Without gauges: the prediction, with the navigation that there is, until the flight state is not known. */
static void coast(Flight *flight) {
    const double *start = flight->base.has_state != 0.0 ? flight->base.state : flight->filter.laws.predicted.mean;
    measure(flight);
    solve(flight, &flight->filter.laws.predicted, start, (size_t)flight->map.warm_iterations, NULL);
    conclude(flight, 0);
    memset(flight->flag + NAVIGATION_USED, 0, N_NAVIGATION);
    const int lost = !flight->flag[TOTAL_INCIDENCE];
    if (lost) {
        set_unknown(flight->output);
        flight->output[SUSPECT_GAUGE] = flight->output[SUSPECTS] = 0.0;
        flight->output[HEALTH_STATE] = INVALID;
    }
    flight->next = flight->base;
    flight->next.stepped = 0.0;
    flight->next.has_state = !lost;
    memcpy(flight->next.state, flight->solver.solution.state, sizeof flight->next.state);
    keep_slopes(flight, NULL, 0.0);
    flight->filter.next.has_law = 1.0;
}

/* Strain at the reference temperature about the predicted amplitudes of modes: the wall stays as soft as it was where a
   sensor is lost. */
static void correct_strain(Flight *flight) {
    const Filter *filter = &flight->filter;
    const Law *law = &filter->laws.predicted;
    if (filter->map.n_modes > 0) {
        readings_set_strain(flight->inputs);
        thermal_correct_about(flight->thermal, law->amplitude, law->mean + first_mode(&filter->laws),
                              flight->inputs->strain);
        flight_set_strain(&flight->solver, flight->inputs);
    }
}

/* How far a rate, by its number among the states, stands out of its deviation, from 0 to 1: flight_track.py. */
static double noticed(const Filter *filter, size_t rate) {
    const double square = filter->laws.law.mean[rate] * filter->laws.law.mean[rate];
    const double both = square + NOTICED * NOTICED * filter->laws.law.covariance[rate * filter->laws.order + rate];
    return both > 0.0 ? square / both : 0.0;
}

/* The flight state of slopes after a time [s], in filter->slope_state, moved as far as the rates are noticed; NULL where
   each iteration takes its own. */
static const double *moved_slopes(Flight *flight, double elapsed) {
    Filter *filter = &flight->filter;
    const double longest = filter->time_constant < filter->map.slope_time ? filter->time_constant : filter->map.slope_time;
    const double own = filter->map.of_age * filter->base.slope_age, time_constant = own < longest ? own : longest;
    if (flight->base.has_state == 0.0 || elapsed >= filter->map.longest_step * time_constant) {
        return NULL;
    }
    const double kept = exponential(-elapsed / time_constant);
    for (size_t k = 0; k < N_STATES; k++) {
        const double state = flight->base.state[k], moved = filter->laws.predicted.mean[k] - filter->laws.law.mean[k];
        const double part = noticed(filter, filter->n_read + k);
        filter->slope_state[k] = state + part * moved + kept * (filter->base.slope_state[k] - state);
    }
    return filter->slope_state;
}

void flight_filter_update(Flight *flight, size_t used) {
    Filter *filter = &flight->filter;
    zero_errors_take(&filter->laws.zeros, flight->inputs->zeros);
    filter_follow_known(filter, &flight->known);
    const int has_law = filter->base.has_law != 0.0 && laws_hold(&filter->laws);
    const double elapsed = elapsed_time(filter->base.time, filter->base.now, filter->map.largest_time);
    const double *slopes = NULL;
    filter->next = filter->base;
    filter->next.has_law = has_law;
    filter->next.time = filter->base.now;
    filter_set_time_constant(filter, flight->inputs->value[filter_setting(flight->inputs)]);
    laws_set_modes(&filter->laws);
    if (has_law) {
        laws_predict(&filter->laws, elapsed, filter->time_constant, filter->base.widening);
        slopes = moved_slopes(flight, elapsed);
        correct_strain(flight);
    }
    if (used == 0 && has_law) {
        coast(flight);
        return;
    }
    if (used == 0) {
        flight_set_nothing_known(flight);
        return;
    }
    if (has_law && flight->base.has_state != 0.0) {
        measure(flight);
        solve(flight, &filter->laws.predicted, flight->base.state, (size_t)flight->map.warm_iterations, slopes);
        if (conclude(flight, used)) {
            keep(flight, used, 0, slopes, filter->base.slope_age + elapsed);
            return;
        }
    }
    begin(flight, used, has_law);
}
