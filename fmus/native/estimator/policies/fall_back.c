/* Loads of the linear map where the tables' loads do not count.

   Three cases: strain does not fit the tables; it has not fitted for return_after steps in a row since then, so that
   one step that fits by chance does not switch the loads back and forth; fewer gauges are in use than the flight
   state has quantities, of which solutions are too many to find them all. The linear map needs q_inf, measured or
   computed. Without it the tables' loads stay, flagged by health; with too few gauges nothing is known.
   docs/explanation/nonlinear_estimator.md, "What comes out" and "Lost gauges". */

#include "fall_back.h"

#include <math.h>

#include "../linear/linear.h"
#include "flight_outputs.h"

/* Loads of the linear map instead of the tables' loads, where it has some. */
static void fall_back(Flight *flight) {
    const double pressure = flight->navigation.of_loads[0], deviation = flight->navigation.of_loads[1];
    if (isfinite(pressure) && linear_loads_at(flight->linear, pressure, deviation)) {
        flight->flag[LINEAR_LOADS] = 1;
    }
}

/* Whether gauges are lost and fewer are in use than the flight state has quantities: solutions of the tables' problem are too
   many then, and too close together, to find them all. */
static int too_few(const Flight *flight, size_t used) {
    return used < N_STATES && used < flight->solver.n_gauges;
}

void flight_fall_back(Flight *flight, size_t used, int fits, double to_return) {
    const int few = too_few(flight, used);
    if (!fits || to_return > 0.0 || few) {
        fall_back(flight);
    }
    if (few && !flight->flag[LINEAR_LOADS]) {
        flight_set_nothing_known(flight, NOT_IDENTIFIED);
        flight->fits = 0;
    }
    flight->conditions |= flight->flag[LINEAR_LOADS] ? LOADS_OF_LINEAR_MAP : 0;
}

double flight_since_search(const Flight *flight, int searched) {
    const double since = flight->base.since_search + 1.0, most = flight->map.search_every;
    return searched ? 0.0 : since < most ? since : most;
}
