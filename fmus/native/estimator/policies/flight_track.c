/* One sample after another: from the last flight state, or from a search of the tables, and which of the two is
   better.

   A step solves from the last state. Where the solution does not fit, it searches the tables in the same step and
   takes the better of both; where it fits but drops air data with an alarm, a search comes at most every
   search_every steps, so that a lasting fault costs a bounded time. The order of qualities is FITS > ALARMS >
   FITS_NOT. An attempt that loses is not kept whole: its state, the state of its S and its precisions suffice to
   compute it again, to the bit.

   Then: other states that fit where no pressure is given (ambiguity.c), other solutions where gauges are lost
   (other_solutions.c), residuals of the gauges, outputs (flight_outputs.c), loads of the linear map where the
   tables' do not count (fall_back.c), and the track for the next step. Strain that fits nowhere does not move the
   state. docs/explanation/nonlinear_estimator.md, "What comes out", "Step by step". */

#include "flight_track.h"

#include <math.h>

#include "../nonlinear/flight_sample.h"
#include "../nonlinear/flight_search.h"
#include "../nonlinear/flight_solve.h"
#include "air_data_faults.h"
#include "ambiguity.h"
#include "fall_back.h"
#include "flight_outputs.h"
#include "other_solutions.h"

/* How good a solution is: strain does not fit, navigation is dropped with an alarm, neither. */
typedef enum { FITS_NOT, ALARMS, FITS } Quality;

/* What it takes to have a solution again: its state and S's, what counts of navigation, and its residuals with all. */
typedef struct {
    double state[N_STATES], weighted_at[N_STATES];
    double precision[N_NAVIGATION], residual[N_NAVIGATION];
} Attempt;

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

static Attempt kept_attempt(const FlightSolver *solver) {
    Attempt kept;
    memcpy(kept.state, solver->state, sizeof kept.state);
    memcpy(kept.weighted_at, solver->factor_state, sizeof kept.weighted_at);
    memcpy(kept.precision, solver->sample.precision, sizeof kept.precision);
    memcpy(kept.residual, solver->solution.navigation_residual, sizeof kept.residual);
    return kept;
}

static void take_again(FlightSolver *solver, const Attempt *kept) {
    memcpy(solver->sample.precision, kept->precision, sizeof kept->precision);
    flight_solve_again(solver, kept->weighted_at, kept->state);
    memcpy(solver->solution.navigation_residual, kept->residual, sizeof kept->residual);
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
    const Attempt kept = kept_attempt(solver);
    const Quality other = attempt(flight, used, 1, quality);
    *searched = 1;
    *by_search = other > quality;
    if (*by_search) {
        return other;
    }
    take_again(solver, &kept);
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
    /* What fits nowhere does not move the state. */
    const int moves = fits || !searched || flight->base.has_state == 0.0;
    next->has_state = 1.0;
    memcpy(next->state, moves ? flight->solver.solution.state : flight->base.state, sizeof next->state);
    next->since_search = flight_since_search(flight, searched);
    next->to_return = to_return;
    next->stepped = 0.0;
}

void flight_track_update(Flight *flight, size_t used) {
    int searched, by_search;
    const Quality quality = solve_best(flight, used, &searched, &by_search);
    widen(flight, quality, &searched, by_search);
    const int is_ambiguous = flight->inputs->n_inertial > 0 || flight_gauges_are_lost(&flight->solver);
    if (is_ambiguous && tables_count(flight, quality)) {
        flight_look_for_others(&flight->solver);
    }
    flight_set_gauge_residuals(&flight->solver);
    const int fits = flight_conclude(flight, used);
    const double to_return = fits ? flight_waiting(flight) : flight->map.return_after;
    flight_fall_back(flight, used, fits, to_return);
    set_next(flight, searched, fits, to_return);
}
