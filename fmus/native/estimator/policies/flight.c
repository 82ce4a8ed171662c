#include "flight.h"

#include <math.h>
#include <stdlib.h>

#include "../filter/filter.h"
#include "../filter/filter_other_loads.h"
#include "../nonlinear/flight_sample.h"
#include "../nonlinear/flight_solver.h"
#include "flight_filter.h"
#include "flight_outputs.h"
#include "flight_track.h"

#define ALIGNMENT 64

/* Read the parts. */
static int parse(Flight *flight, MapFile *file) {
    const Inputs *inputs = flight->inputs;
    const size_t n = inputs->map->n_gauges, n_loads = flight->loads->map.n_loads;
    FlightOtherLoadsMap *loads = &flight->other_loads.map;
    Known *known = &flight->known;
    Filter *filter = &flight->filter;
    known->present = inputs->map->has_known;
    filter->present = inputs->map->has_filter;
    if (!flight_map_parse(file, n, &flight->map)
        || (map_has(file, "flight_loads") && !flight_other_loads_parse(file, &flight->map, n, n_loads, loads))
        || (map_has(file, "considered") && !considered_parse(file, n + N_LOADS + n_loads, &flight->map))
        || (known->present && !known_map_parse(file, &flight->map, n, loads->tables.n_rows, &known->map))
        || (filter->present && !filter_map_parse(file, n, &filter->map))) {
        return 0;
    }
    if (known->present) {
        map_require(file, known->map.n_parameters == inputs->parameters->count, "parameter_tables.mean",
                    "the parameters of the map");
    }
    if (filter->present) {
        map_require(file, filter->map.n_other == n_loads, "filter.other_load", "the section loads of the map");
        map_require(file, filter->map.n_modes == flight->thermal->map.n_modes, "filter.n_modes", "that of the temperature modes");
    }
    known_lay_out(&flight->map.tables, &loads->tables, known);
    return file->good;
}

/* One block for all arrays. */
static int allocate(Flight *flight) {
    const size_t n = flight->inputs->map->n_gauges;
    FlightSolver *solver = &flight->solver;
    FlightOtherLoads *other_loads = &flight->other_loads;
    Known *known = &flight->known;
    Filter *filter = &flight->filter;
    solver->map = &flight->map;
    solver->n = in_lanes(n);
    filter->laws.n_parameters = known->present ? known->map.n_parameters : 0;
    const size_t count = flight_solver_doubles(&flight->map, n) + flight_other_loads_doubles(&other_loads->map, n)
                       + (known->present ? known_doubles(known, n) : 0)
                       + (filter->present ? filter_doubles(filter, solver, flight->thermal, flight->inputs->sensors->n_strains) : 0);
    flight->memory = calloc(1, ALIGNMENT + count * sizeof(double) + n);
    if (flight->memory == NULL) {
        return 0;
    }
    unsigned char *start = flight->memory;
    double *doubles = (double *)(void *)(start + (ALIGNMENT - (uintptr_t)start % ALIGNMENT));
    unsigned char *bytes = (unsigned char *)(doubles + count);
    flight_solver_arrays(&flight->map, n, flight->linear->wide, solver, &doubles, &bytes);
    flight_other_loads_arrays(other_loads, n, &doubles);
    if (known->present) {
        known_arrays(&flight->map, solver, other_loads, known, &doubles);
    }
    if (filter->present) {
        filter_arrays(filter, &doubles);
    }
    return 1;
}

int flight_create(Flight *flight, MapFile *file) {
    if (!map_has(file, "flight")) {
        return file->good;
    }
    if (!parse(flight, file)) {
        return 0;
    }
    if (!allocate(flight)) {
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

/* The filter is off: it leaves nothing. */
static void forget_law(Filter *filter) {
    filter->next = filter->base;
    filter->next.has_law = filter->next.steps = 0.0;
    filter->next.mean = filter->next.widening = 1.0;
    memset(filter->next.apart, 0, sizeof filter->next.apart);
    memset(filter->next.alarms, 0, sizeof filter->next.alarms);
}

/* Tables are others: what a filter has kept of them is not theirs. */
static void forget_slopes(Flight *flight, int changed) {
    if (changed) {
        flight->filter.slope_response.known = 0;
    }
}

void flight_update(Flight *flight) {
    const size_t used = flight_set_strain(&flight->solver, flight->inputs);
    flight->output[VALID_GAUGES] = (double)used;
    flight->solver.iterations = 0;
    navigation_of(&flight->map, flight->inputs, &flight->navigation);
    measured_angles(flight->inputs, &flight->solver.angles);
    forget_slopes(flight, known_follow(&flight->known, flight->inputs));
    if (flight_filters(flight)) {
        flight_filter_update(flight, used);
        memset(flight->next.widening, 0, sizeof flight->next.widening);
        return;
    }
    if (flight->filter.present) {
        forget_law(&flight->filter);
    }
    if (used == 0) {
        flight_set_nothing_known(flight);
    } else {
        flight_track_update(flight, used);
    }
}

void flight_other_loads_update(Flight *flight) {
    if (flight_filters(flight)) {
        if (isnan(flight->output[LOADS])) {
            other_loads_unknown(flight->loads);
        } else {
            filter_other_loads(&flight->filter, &flight->other_loads, flight->inputs, flight->loads);
        }
    } else if (flight->output[VALID_GAUGES] == 0.0) {
        other_loads_unknown(flight->loads);
    } else {
        flight_other_loads_at(&flight->other_loads, &flight->solver, flight->inputs, flight->loads);
    }
}

/* flight_track.c solves from the last state and by a search, each with all of navigation and without what is inconsistent.
   Then it may go over to another end of the searches, and looks to both sides of what it has found. A filter takes fewer. */
size_t flight_most_iterations(const Flight *flight) {
    const FlightMap *map = &flight->map;
    const size_t start = (size_t)map->start_iterations, cold = (size_t)map->cold_iterations;
    const size_t attempts = 2, sides = 2;
    return attempts * ((size_t)map->warm_iterations + cold) + KEPT_SEARCHES * SEARCH_STARTS * start + cold
         + sides * ASIDE_ITERATIONS;
}

void flight_renew(Flight *flight) {
    const AddedNoise *noise = &flight->linear->prepared.noise;
    forget_slopes(flight, known_forget(&flight->known));
    flight_solver_add_noise(&flight->solver, noise->own, noise->added);
}

static int is_state(const double state[N_STATES]) {
    int good = 1;
    for (size_t k = 0; k < N_STATES; k++) {
        good = good && isfinite(state[k]);
    }
    return good;
}

void flight_take_next(Flight *flight, double time) {
    Filter *filter = &flight->filter;
    if (!is_state(flight->next.state)) { /* a map of extreme numbers: nothing to go on from */
        memset(&flight->next, 0, sizeof flight->next);
        if (filter->present) {
            forget_law(filter);
        }
    }
    flight->base = flight->next;
    flight->base.stepped = 0.0;
    laws_take_next(&filter->laws);
    filter->base = filter->next;
    filter->base.now = time;
}

int flight_track_fits(const Flight *flight, const Track *track) {
    int good = (track->has_state == 0.0 || track->has_state == 1.0)
            && (track->stepped == 0.0 || track->stepped == 1.0)
            && track->since_search >= 0.0 && track->since_search <= flight->map.search_every
            && track->to_return >= 0.0 && track->to_return <= flight->map.return_after && is_state(track->state);
    const int is_widened = track->widening[0] != 0.0;
    for (size_t k = 0; k < N_WIDENING; k++) {
        const double factor = track->widening[k];
        good = good && (is_widened ? factor >= 1.0 && isfinite(factor) : factor == 0.0);
    }
    return good;
}
