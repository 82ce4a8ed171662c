#include "flight_track.h"

#include "../nonlinear/flight_sample.h"
#include "../nonlinear/flight_solve.h"
#include "air_data_faults.h"
#include "ambiguity.h"
#include "fall_back.h"
#include "flight_outputs.h"

/* How good a solution is: strain does not fit, navigation is dropped with an alarm, neither. */
enum { FITS_NOT, ALARMS, FITS };

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

/* Solve, a second time without navigation that is inconsistent, and write the solution to the outputs. */
static int attempt(Flight *flight, size_t used, int search) {
    double residual[N_NAVIGATION];
    flight->searched_again = 0;
    flight_set_measurement(&flight->solver, flight->value, flight->std);
    solve(flight, search);
    memcpy(residual, flight->solver.solution.navigation_residual, sizeof residual);
    if (flight_drop_inconsistent(flight)) {
        solve(flight, search);
        memcpy(flight->solver.solution.navigation_residual, residual, sizeof residual);
    }
    return !flight_conclude(flight, used) ? FITS_NOT : flight_navigation_alarms(flight) ? ALARMS : FITS;
}

/* From the last state and, where that does not fit, from a search in the same step; the better. Where it fits but drops
   navigation with an alarm, the search comes once in a while. At most three attempts, each of a fixed number of
   iterations. */
static int best_attempt(Flight *flight, size_t used, int *searched) {
    const Track *base = &flight->base;
    const int first = base->has_state == 0.0, found = attempt(flight, used, first);
    *searched = first || flight->searched_again;
    if (first || found == FITS || (found == ALARMS && base->since_search < flight->map.search_every)) {
        return found;
    }
    *searched = 1;
    const int by_search = attempt(flight, used, 1);
    return by_search > found ? by_search : attempt(flight, used, 0);
}

void flight_track_update(Flight *flight, size_t used) {
    int searched;
    const int fits = best_attempt(flight, used, &searched) != FITS_NOT;
    const double to_return = fits ? flight_waiting(flight) : flight->map.return_after;
    flight_fall_back(flight, fits, to_return);
    set_next(flight, searched, fits, to_return);
}
