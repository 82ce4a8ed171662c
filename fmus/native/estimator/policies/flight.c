/* The nonlinear estimator as a whole: its parts of map.bin, its memory, one update of all outputs, and the track
   from step to step.

   An update goes: readings in use (flight_sample.c), air data and angles, tables about known flow parameters
   (flight_known.c), then the solution and what is made of it (flight_track.c). It starts from track `base` and
   writes track `next`, without changing base: outputs may be computed any number of times for different inputs until
   a step makes next the base (flight_take_next). The most iterations of a step follow from the numbers in the map:
   docs/reference/step_time.md, "Iterations". docs/explanation/nonlinear_estimator.md, "What comes out". */

#include "flight.h"

#include <math.h>
#include <stdlib.h>

#include "../linear/linear_other_loads.h"
#include "../nonlinear/flight_sample.h"
#include "../nonlinear/flight_solver.h"
#include "flight_outputs.h"
#include "flight_track.h"

/* Tables first: the other parts are on their knots. */
static int parse(Flight *flight, MapFile *file) {
    const Inputs *inputs = flight->inputs;
    const size_t n = inputs->map->n_gauges, n_loads = flight->loads->map.n_loads;
    FlightOtherLoadsMap *loads = &flight->other_loads.map;
    Known *known = &flight->known;
    known->present = inputs->map->has_known;
    if (!flight_map_parse(file, n, &flight->map)
        || (map_has(file, "flight_loads") && !flight_other_loads_parse(file, &flight->map, n_loads, loads))
        || !considered_parse(file, n, N_LOADS + n_loads, &flight->map)
        || (known->present && !known_map_parse(file, &flight->map, n, loads->tables.n_rows, &known->map))) {
        return 0;
    }
    if (known->present) {
        map_require(file, known->map.n_parameters == inputs->parameters->count, "parameter_tables.mean",
                    "the parameters of the map");
    }
    known_lay_out(&flight->map.tables, &loads->tables, known);
    return file->good;
}

/* One block for all arrays. */
static int allocate(Flight *flight, MapFile *file) {
    const size_t n = flight->inputs->map->n_gauges;
    FlightSolver *solver = &flight->solver;
    FlightOtherLoads *other_loads = &flight->other_loads;
    Known *known = &flight->known;
    solver->map = &flight->map;
    solver->n = in_lanes(n);
    const size_t count = flight_solver_doubles(&flight->map, n) + flight_other_loads_doubles(&other_loads->map, n)
                       + (known->present ? known_doubles(known, n) : 0);
    double *doubles = map_take(file, count * sizeof(double) + n);
    if (doubles == NULL) {
        return 0;
    }
    unsigned char *bytes = (unsigned char *)(doubles + count);
    flight_solver_arrays(&flight->map, n, flight->linear->wide, solver, &doubles, &bytes);
    flight_other_loads_arrays(other_loads, n, &doubles);
    if (known->present) {
        known_arrays(&flight->map, solver, other_loads, known, &doubles);
    }
    return 1;
}

int flight_create(Flight *flight, MapFile *file) {
    if (!map_has(file, "flight")) {
        return file->good;
    }
    if (!parse(flight, file) || !allocate(flight, file)) {
        return 0;
    }
    for (size_t k = 0; k < N_STATES; k++) {
        flight->prior_std[k] = 1.0 / sqrt(flight->map.prior_precision[k]);
    }
    flight->present = 1;
    return 1;
}

void flight_reset(Flight *flight) {
    memset(&flight->base, 0, sizeof flight->base);
    memset(&flight->next, 0, sizeof flight->next);
}

void flight_update(Flight *flight) {
    const size_t used = flight_set_strain(&flight->solver, flight->inputs);
    flight->output[VALID_GAUGES] = (double)used;
    flight->solver.iterations = 0;
    navigation_of(&flight->map, flight->inputs, &flight->navigation);
    measured_angles(flight->inputs, &flight->solver.angles);
    known_follow(&flight->known, flight->inputs);
    if (used == 0) {
        flight_set_nothing_known(flight, NO_GAUGE);
    } else {
        flight_track_update(flight, used);
    }
}

/* By the tables, or by the linear map where it stands in or is alone; unknown where nothing is estimated. */
void flight_other_loads_update(Flight *flight) {
    flight->loads->outdated = 0;
    if (!flight->present || flight->flag[LINEAR_LOADS]) {
        linear_other_loads_update(flight->linear);
    } else if (flight->output[VALID_GAUGES] == 0.0 || (flight->conditions & NOT_IDENTIFIED)) {
        other_loads_unknown(flight->loads);
    } else {
        flight_other_loads_at(&flight->other_loads, &flight->solver, flight->inputs, flight->loads);
    }
}

/* flight_track.c solves from the last state and by a search, each with all of navigation and without what is inconsistent.
   Then it may go over to another end of the searches, looks to both sides of what it has found, and for other solutions
   where gauges are lost. */
size_t flight_most_iterations(const Flight *flight) {
    const FlightMap *map = &flight->map;
    const size_t start = (size_t)map->start_iterations, cold = (size_t)map->cold_iterations;
    const size_t attempts = 2, sides = 2;
    return attempts * ((size_t)map->warm_iterations + cold) + KEPT_SEARCHES * SEARCH_STARTS * start + cold
         + sides * ASIDE_ITERATIONS + MOST_OTHERS * start;
}

void flight_renew(Flight *flight) {
    const AddedNoise *noise = &flight->linear->prepared.noise;
    known_forget(&flight->known);
    flight_solver_add_noise(&flight->solver, noise->own, noise->added);
}

static int is_state(const double state[N_STATES]) {
    int good = 1;
    for (size_t k = 0; k < N_STATES; k++) {
        good = good && isfinite(state[k]);
    }
    return good;
}

void flight_take_next(Flight *flight) {
    if (!is_state(flight->next.state)) { /* a map of extreme numbers: nothing to go on from */
        memset(&flight->next, 0, sizeof flight->next);
    }
    flight->base = flight->next;
    flight->base.stepped = 0.0;
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
