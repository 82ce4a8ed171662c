/* The nonlinear estimator as a whole: its parts of map.bin, its memory, one update of all outputs, and the track
   from step to step.

   An update goes: readings in use (flight_sample.c), air data and angles, tables about known flow parameters
   (flight_known.c), then the solution and what is made of it (below). It starts from track `base` and
   writes track `next`, without changing base: outputs may be computed any number of times for different inputs until
   a step makes next the base (flight_take_next). The most iterations of a step follow from the numbers in the map:
   docs/reference/step_time.md, "Iterations". docs/explanation/nonlinear_estimator.md, "What comes out". */

#include "policies.h"

#include <math.h>
#include <stdlib.h>

/* Loads of the linear map where the tables' loads do not count.

   Three cases: strain does not fit the tables; it has not fitted for return_after steps in a row since then, so that
   one step that fits by chance does not switch the loads back and forth; fewer gauges are in use than the flight
   state has quantities, of which solutions are too many to find them all. The linear map needs q_inf, measured or
   computed. Without it the tables' loads stay, flagged by health; with too few gauges nothing is known.
   docs/explanation/nonlinear_estimator.md, "What comes out" and "Lost gauges". */

/* Loads of the linear map instead of the tables' loads, where it has some, and where these do not fit or have not for
   long enough, or where fewer gauges are left than the flight state has quantities; UNIDENTIFIED where it has none
   then. */
static void flight_fall_back(Flight *flight, size_t used, int fits, double to_return) {
    const double pressure = flight->navigation.of_loads[0], deviation = flight->navigation.of_loads[1];
    /* Solutions of the tables' problem are too many then, and too close together, to find them all. */
    const int few = used < N_STATES && used < flight->solver.n_gauges, instead = !fits || to_return > 0.0 || few;
    if (instead && isfinite(pressure) && linear_loads_at(flight->linear, pressure, deviation)) {
        flight->flag[LINEAR_LOADS] = 1;
    }
    if (few && !flight->flag[LINEAR_LOADS]) {
        flight_set_nothing_known(flight, NOT_IDENTIFIED);
        flight->fits = 0;
    }
    flight->conditions |= flight->flag[LINEAR_LOADS] ? LOADS_OF_LINEAR_MAP : 0;
}

/* One sample after another: from the last flight state, or from a search of the tables, and which of the two is
   better.

   A step solves from the last state. Where the solution does not fit, it searches the tables in the same step and
   takes the better of both; where it fits but drops air data with an alarm, a search comes at most every
   search_every steps, so that a lasting fault costs a bounded time. The order of qualities is FITS > ALARMS >
   FITS_NOT. An attempt that loses is not kept whole: its state, the state of its S and its precisions suffice to
   compute it again, to the bit.

   Then: other states that fit where no pressure is given (ambiguity.c), other solutions where gauges are lost
   (ambiguity.c), residuals of the gauges, outputs (flight_outputs.c), loads of the linear map where the
   tables' do not count, and the track for the next step. Strain that fits nowhere does not move the
   state. docs/explanation/nonlinear_estimator.md, "What comes out", "Step by step". */

/* How good a solution is: strain does not fit, navigation is dropped with an alarm, neither. */
typedef enum { FITS_NOT, ALARMS, FITS } Quality;

static void solve(Flight *flight, int search) {
    if (search) {
        flight_solve_cold(&flight->solver);
    } else {
        flight_solve_warm(&flight->solver, flight->base.state);
    }
}

/* Solve from the last state or from a search, a second time without air data that are inconsistent, unless the
   solution cannot become better than `quality`. */
static Quality attempt(Flight *flight, size_t used, int search, Quality quality) {
    double residual[N_NAVIGATION];
    flight_set_measurement(&flight->solver, flight->navigation.value, flight->navigation.std);
    solve(flight, search);
    memcpy(residual, flight->solver.solution.navigation_residual, sizeof residual);
    if (flight_drop_inconsistent(flight)) {
        if (quality == ALARMS && flight_navigation_alarms(flight)) {
            return ALARMS;
        }
        solve(flight, search);
        memcpy(flight->solver.solution.navigation_residual, residual, sizeof residual);
    }
    return !flight_solution_fits(flight, used) ? FITS_NOT : flight_navigation_alarms(flight) ? ALARMS : FITS;
}

/* Residuals of air data are of the solution with all of them, and stay. */
static void widen_by(FlightSolver *solver, void (*look)(FlightSolver *)) {
    double residual[N_NAVIGATION];
    memcpy(residual, solver->solution.navigation_residual, sizeof residual);
    look(solver);
    memcpy(solver->solution.navigation_residual, residual, sizeof residual);
}

/* Solve from the last state and, where that does not fit, from a search in the same step; the better. Where it fits but
   drops navigation with an alarm, the search comes once in a while. Whether the tables were searched, and whether the
   solution comes from there. */
static Quality solve_best(Flight *flight, size_t used, int *searched, int *by_search) {
    FlightSolver *solver = &flight->solver;
    const Track *base = &flight->base;
    const int first = base->has_state == 0.0;
    const Quality quality = attempt(flight, used, first, FITS_NOT);
    *searched = *by_search = first;
    if (first || quality == FITS || (quality == ALARMS && base->since_search < flight->map.search_every)) {
        return quality;
    }
    const KeptSolution kept = flight_keep(solver);
    const Quality other = attempt(flight, used, 1, quality);
    *searched = 1;
    *by_search = other > quality;
    if (*by_search) {
        return other;
    }
    flight_take_again(solver, &kept);
    return quality;
}

/* Whether loads of the tables count: the linear map's stand in where strain does not fit and there are some. */
static int tables_count(const Flight *flight, Quality quality) {
    return quality != FITS_NOT || !isfinite(flight->navigation.of_loads[0]);
}

/* Where air data give no pressure, widen the solution by what else fits: of a search, of another search where it is
   due, or by the factors of the last one. Where loads of the linear map stand in, nothing is looked for. */
static void widen(Flight *flight, Quality quality, int *searched, int by_search) {
    FlightSolver *solver = &flight->solver;
    const Track *base = &flight->base;
    const int known = base->widening[0] != 0.0, due = !known || base->since_search >= flight->map.search_every;
    if (!flight_pressure_unknown(solver)) {
        memcpy(flight->next.widening, by_search ? solver->solution.widening : base->widening, sizeof base->widening);
        return;
    }
    if (by_search) {
        widen_by(solver, flight_widen_searched);
    } else if (due && tables_count(flight, quality)) {
        widen_by(solver, flight_search_more);
        *searched = 1;
    } else if (known) {
        flight_widen(solver, base->widening);
    }
    memcpy(flight->next.widening, solver->solution.widening, sizeof flight->next.widening);
}

/* What the step leaves to the next one. */
static void set_next(Flight *flight, int searched, int fits, double to_return) {
    Track *next = &flight->next;
    const double since = flight->base.since_search + 1.0, most = flight->map.search_every;
    /* What fits nowhere does not move the state. */
    const int moves = fits || !searched || flight->base.has_state == 0.0;
    next->has_state = 1.0;
    memcpy(next->state, moves ? flight->solver.solution.state : flight->base.state, sizeof next->state);
    next->since_search = searched ? 0.0 : since < most ? since : most;
    next->to_return = to_return;
    next->stepped = 0.0;
}

/* Set all outputs by the tables, for so many gauges in use, which is not 0. */
static void flight_track_update(Flight *flight, size_t used) {
    int searched, by_search;
    const Quality quality = solve_best(flight, used, &searched, &by_search);
    widen(flight, quality, &searched, by_search);
    const int is_ambiguous = flight->inputs->n_inertial > 0 || flight_gauges_are_lost(&flight->solver);
    if (is_ambiguous && tables_count(flight, quality)) {
        flight_look_for_others(&flight->solver);
    }
    flight_set_gauge_residuals(&flight->solver);
    const int fits = flight_conclude(flight, used);
    /* Steps that still must fit after this one. */
    const double to_return = fits ? larger(flight->base.to_return - 1.0, 0.0) : flight->map.return_after;
    flight_fall_back(flight, used, fits, to_return);
    set_next(flight, searched, fits, to_return);
}

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

static void lay_out(void *part, Room *room) {
    Flight *flight = part;
    const size_t n = flight->inputs->map->n_gauges;
    flight_solver_arrays(&flight->map, n, flight->linear->wide, &flight->solver, room);
    flight_other_loads_arrays(&flight->other_loads, n, room);
    if (flight->known.present) {
        known_arrays(&flight->map, &flight->solver, &flight->other_loads, &flight->known, room);
    }
}

int flight_create(Flight *flight, MapFile *file) {
    if (!map_has(file, "flight")) {
        return file->good;
    }
    if (!parse(flight, file) || !map_hand_out(file, lay_out, flight)) {
        return 0;
    }
    flight_search_prepare(&flight->solver);
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

/* A step solves from the last state and by a search, each with all of navigation and without what is inconsistent.
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
    flight_search_weigh(&flight->solver);
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
    int good = is_flag(track->has_state) && is_flag(track->stepped)
            && track->since_search >= 0.0 && track->since_search <= flight->map.search_every
            && track->to_return >= 0.0 && track->to_return <= flight->map.return_after && is_state(track->state);
    const int is_widened = track->widening[0] != 0.0;
    for (size_t k = 0; k < N_WIDENING; k++) {
        const double factor = track->widening[k];
        good = good && (is_widened ? factor >= 1.0 && isfinite(factor) : factor == 0.0);
    }
    return good;
}
