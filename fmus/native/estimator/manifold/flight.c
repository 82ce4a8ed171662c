#include "flight.h"

#include <math.h>
#include <stdlib.h>

#include "../../core/elementary.h"
#include "../step_parts.h"
#include "flight_ambiguity.h"
#include "flight_parts.h"

#define ALIGNMENT 64

/* How good a solution is: strain does not fit, navigation is dropped with an alarm, neither. */
enum { FITS_NOT, ALARMS, FITS };

/* Read the parts. */
static int parse(Estimator *e, MapFile *file) {
    Flight *flight = &e->flight;
    const size_t n = e->map.n_gauges, n_loads = e->further.map.n_loads;
    FlightFurtherMap *loads = &flight->further.map;
    Known *known = &flight->known;
    Filter *filter = &flight->filter;
    known->present = e->map.has_known;
    filter->present = e->map.has_filter;
    if (!flight_map_parse(file, n, &flight->map)
        || (map_has(file, "flight_loads") && !flight_further_parse(file, &flight->map, n, n_loads, loads))
        || (known->present && !known_map_parse(file, &flight->map, n, loads->tables.n_rows, &known->map))
        || (filter->present && !filter_map_parse(file, n, &filter->map))) {
        return 0;
    }
    if (known->present) {
        map_require(file, known->map.n_parameters == e->parameters.count, "parameter_tables.mean",
                    "the parameters of the map");
    }
    if (filter->present) {
        map_require(file, filter->map.n_further == n_loads, "filter.further_load", "the section loads of the map");
        map_require(file, filter->map.n_modes == e->thermal.map.n_modes, "filter.n_modes", "that of the temperature modes");
    }
    known_lay_out(&flight->map.tables, &loads->tables, known);
    return file->good;
}

/* One block for all arrays. */
static int allocate(Estimator *e) {
    Flight *flight = &e->flight;
    const size_t n = e->map.n_gauges;
    FlightSolver *solver = &flight->solver;
    FlightFurther *further = &flight->further;
    Known *known = &flight->known;
    Filter *filter = &flight->filter;
    solver->map = &flight->map;
    solver->n = in_lanes(n);
    filter->n_parameters = known->present ? known->map.n_parameters : 0;
    const size_t count = flight_solver_doubles(&flight->map, n) + flight_further_doubles(&further->map, n)
                       + (known->present ? known_doubles(known, n) : 0)
                       + (filter->present ? filter_doubles(filter, solver, &e->thermal, e->sensors.n_strains) : 0);
    flight->memory = calloc(1, ALIGNMENT + count * sizeof(double) + n);
    if (flight->memory == NULL) {
        return 0;
    }
    unsigned char *start = flight->memory;
    double *doubles = (double *)(void *)(start + (ALIGNMENT - (uintptr_t)start % ALIGNMENT));
    unsigned char *bytes = (unsigned char *)(doubles + count);
    flight_solver_arrays(&flight->map, n, e->wide, solver, &doubles, &bytes);
    flight_further_arrays(further, n, &doubles);
    if (known->present) {
        known_arrays(e, &doubles);
    }
    if (filter->present) {
        filter_arrays(filter, &doubles);
    }
    return 1;
}

int flight_create(Estimator *e, MapFile *file) {
    Flight *flight = &e->flight;
    if (!map_has(file, "flight")) {
        return file->good;
    }
    if (!parse(e, file)) {
        return 0;
    }
    if (!allocate(e)) {
        return map_no_memory(file);
    }
    for (size_t k = 0; k < N_STATES; k++) {
        flight->prior_std[k] = 1.0 / sqrt(flight->map.prior_precision[k]);
    }
    flight->present = 1;
    return 1;
}

void flight_free(Flight *flight) {
    free(flight->memory);
}

void flight_reset(Flight *flight) {
    memset(&flight->base, 0, sizeof flight->base);
    memset(&flight->next, 0, sizeof flight->next);
    if (flight->filter.present) {
        filter_reset(&flight->filter);
    }
}

size_t flight_set_strain(Estimator *e) {
    const double range = e->input[e->map.n_gauges + SENSOR_RANGE];
    const int silent = estimator_silent(e);
    Sample *sample = &e->flight.solver.sample;
    size_t count = 0;
    for (size_t g = 0; g < e->map.n_gauges; g++) {
        sample->used[g] = !silent && gauge_in_use(e, g, range);
        sample->strain[g] = sample->used[g] ? e->strain[g] : 0.0;
        count += sample->used[g];
    }
    e->flight.solver.n_kept = 0;
    return count;
}

/* p(h); NaN where the altitude is not known, 0, which no flight has, where it is above the atmosphere. */
static double pressure_by_altitude(const Estimator *e) {
    const double altitude = known_input(e, ALTITUDE), found = ambient_pressure(&e->map.envelope, altitude);
    return isnan(found) && !isnan(altitude) ? 0.0 : found;
}

double flight_navigation_error(const Estimator *e, size_t quantity) {
    const FlightMap *map = &e->flight.map;
    const int by_altitude = quantity == 1 && isnan(known_input(e, STATIC_PRESSURE));
    return by_altitude ? map->altitude_error : map->error[quantity];
}

/* Navigation of the inputs, each with a deviation. */
static void set_navigation(Estimator *e) {
    Flight *flight = &e->flight;
    double *value = flight->value, *std = flight->std;
    value[0] = known_input(e, MACH_NUMBER);
    value[1] = known_input(e, STATIC_PRESSURE);
    value[1] = isnan(value[1]) ? pressure_by_altitude(e) : value[1];
    value[2] = known_input(e, DYNAMIC_PRESSURE);
    std[0] = known_input(e, MACH_NUMBER_STD);
    std[1] = known_input(e, STATIC_PRESSURE_STD);
    std[2] = known_input(e, DYNAMIC_PRESSURE_STD);
    for (size_t k = 0; k < N_NAVIGATION; k++) {
        const double own = flight_navigation_error(e, k) * (k == 0 ? 1.0 : value[k]);
        const double least = MIN_RELATIVE_STD * fabs(value[k]);
        std[k] = isnan(std[k]) ? own : std[k];
        std[k] = std[k] > least ? std[k] : least;
    }
}

void flight_set_measurement(Flight *flight) {
    Sample *sample = &flight->solver.sample;
    for (size_t k = 0; k < N_NAVIGATION; k++) {
        const double value = flight->value[k], std = flight->std[k];
        const double scale = k == 0 ? std : std / value, precision = 1.0 / (scale * scale);
        const int known = isfinite(value) && value > 0.0 && isfinite(std) && std > 0.0 && precision > 0.0 && isfinite(precision);
        sample->value[k] = !known ? 0.0 : k == 0 ? value : logarithm(value);
        sample->precision[k] = known ? precision : 0.0;
    }
    memcpy(sample->value + N_NAVIGATION, flight->map.prior_mean, sizeof flight->map.prior_mean);
    memcpy(sample->precision + N_NAVIGATION, flight->map.prior_precision, sizeof flight->map.prior_precision);
}

/* From a search or from the last state, and what that leaves of the factors on deviations. */
static void solve(Flight *flight, int search) {
    FlightSolver *solver = &flight->solver;
    const Track *base = &flight->base;
    double *left = flight->next.widening;
    if (search) {
        flight_search_widened(solver);
    } else if (!flight_pressure_untold(solver)) {
        flight_solve_warm(solver, base->state);
        memcpy(left, base->widening, sizeof base->widening);
        return;
    } else if (base->widening[0] == 0.0 || base->since_search >= flight->map.search_every) {
        flight_search_again(solver, base->state);
        flight->searched_again = 1;
    } else {
        flight_solve_warm(solver, base->state);
        flight_widen(solver, base->widening);
    }
    memcpy(left, solver->solution.widening, sizeof flight->next.widening);
}

int flight_drop_inconsistent(Flight *flight) {
    const double *residual = flight->solver.solution.navigation_residual;
    size_t worst = 0;
    double largest = -1.0;
    for (size_t k = 0; k < N_NAVIGATION; k++) {
        const double excess = fabs(residual[k]) / flight->map.navigation_limit[k];
        if (excess > largest) {
            largest = excess;
            worst = k;
        }
    }
    if (!(largest > 1.0)) {
        return 0;
    }
    double *precision = flight->solver.sample.precision;
    for (size_t k = 0; k < N_NAVIGATION; k++) {
        const double widening =
            navigation_may_be_wrong(flight, residual[worst], residual[k]) ? fabs(residual[worst]) + 1.0 : 1.0;
        precision[k] = k == worst ? 0.0 : precision[k] / (widening * widening);
    }
    return 1;
}

double flight_since_search(const Flight *flight, int searched) {
    const double since = flight->base.since_search + 1.0, most = flight->map.search_every;
    return searched ? 0.0 : since < most ? since : most;
}

/* What the step leaves to the next one. */
static void set_next(Flight *flight, int searched, int fits, double to_return) {
    Track *next = &flight->next;
    /* What fits nowhere does not move the state. */
    const int moves = fits || !searched || flight->base.has_state == 0.0;
    next->has_state = 1.0;
    memcpy(next->state, moves ? flight->solver.solution.state : flight->base.state, sizeof next->state);
    next->since_search = flight_since_search(flight, searched);
    next->to_return = to_return;
    next->stepped = 0.0;
}

/* The filter is off: it leaves nothing. */
static void forget_law(Filter *filter) {
    filter->next = filter->base;
    filter->next.has_law = filter->next.steps = 0.0;
    filter->next.mean = filter->next.widening = 1.0;
    memset(filter->next.apart, 0, sizeof filter->next.apart);
    memset(filter->next.alarms, 0, sizeof filter->next.alarms);
}

/* Solve, a second time without navigation that is inconsistent, and write the solution to the outputs. */
static int attempt(Estimator *e, size_t used, int search) {
    Flight *flight = &e->flight;
    double residual[N_NAVIGATION];
    flight->searched_again = 0;
    flight_set_measurement(flight);
    solve(flight, search);
    memcpy(residual, flight->solver.solution.navigation_residual, sizeof residual);
    if (flight_drop_inconsistent(flight)) {
        solve(flight, search);
        memcpy(flight->solver.solution.navigation_residual, residual, sizeof residual);
    }
    return !flight_conclude(e, used) ? FITS_NOT : flight_navigation_alarms(flight) ? ALARMS : FITS;
}

/* From the last state and, where that does not fit, from a search in the same step; the better. Where it fits but drops
   navigation with an alarm, the search comes once in a while. At most three attempts, each of a fixed number of
   iterations. */
static int best_attempt(Estimator *e, size_t used, int *searched) {
    const Track *base = &e->flight.base;
    const int first = base->has_state == 0.0, found = attempt(e, used, first);
    *searched = first || e->flight.searched_again;
    if (first || found == FITS || (found == ALARMS && base->since_search < e->flight.map.search_every)) {
        return found;
    }
    *searched = 1;
    const int by_search = attempt(e, used, 1);
    return by_search > found ? by_search : attempt(e, used, 0);
}

void flight_update(Estimator *e) {
    Flight *flight = &e->flight;
    const size_t used = flight_set_strain(e);
    int searched;
    e->output[VALID_GAUGES] = (double)used;
    set_navigation(e);
    known_follow(e);
    if (flight_filters(e)) {
        flight_filter_update(e, used);
        memset(flight->next.widening, 0, sizeof flight->next.widening);
        return;
    }
    if (flight->filter.present) {
        forget_law(&flight->filter);
    }
    if (used == 0) {
        flight_set_nothing_known(e);
        return;
    }
    const int fits = best_attempt(e, used, &searched) != FITS_NOT;
    const double to_return = fits ? flight_waiting(flight) : flight->map.return_after;
    flight_fall_back(e, fits, to_return);
    set_next(flight, searched, fits, to_return);
}

/* What the step left is what the next one starts from, at the present point in time. */
static void take_next(Estimator *e) {
    Filter *filter = &e->flight.filter;
    const Law law = filter->law;
    e->flight.base = e->flight.next;
    e->flight.base.stepped = 0.0;
    filter->law = filter->next_law;
    filter->next_law = law;
    filter->base = filter->next;
    filter->base.now = e->base.time;
}

void flight_before_change(Estimator *e) {
    if (e->flight.base.stepped != 0.0) {
        estimator_outputs(e);
        take_next(e);
    }
    e->outdated = 1;
}

void flight_step(Estimator *e, double start) {
    Filter *filter = &e->flight.filter;
    if (e->flight.base.stepped != 0.0) {
        flight_before_change(e);
    }
    if (flight_filters(e) && filter->base.now != start) {
        filter->base.now = start;
        e->outdated = 1;
    }
    estimator_outputs(e);
    e->flight.base.stepped = 1.0;
}

int flight_track_fits(const Flight *flight, const Track *track) {
    int good = (track->has_state == 0.0 || track->has_state == 1.0)
            && (track->stepped == 0.0 || track->stepped == 1.0)
            && track->since_search >= 0.0 && track->since_search <= flight->map.search_every
            && track->to_return >= 0.0 && track->to_return <= flight->map.return_after;
    for (size_t k = 0; k < N_STATES; k++) {
        good = good && isfinite(track->state[k]);
    }
    const int is_widened = track->widening[0] != 0.0;
    for (size_t k = 0; k < N_WIDENING; k++) {
        const double factor = track->widening[k];
        good = good && (is_widened ? factor >= 1.0 && isfinite(factor) : factor == 0.0);
    }
    return good;
}
