/* Health of a sample: the state of the first condition that holds, from top to bottom of one table, CONDITIONS.

   The linear and the nonlinear estimator, filter, renewal and inertia note what they know of a sample as bits (sample.h);
   none of them chooses a state. The order says what explains a sample best:

       nothing can be computed    no gauge reads; the gauges in use do not identify the loads; no dynamic pressure
       FLOW_OUTSIDE               before INCONSISTENT: beyond its range a map is expected to fit badly. The nonlinear
                                  estimator includes its own flight state, which is part of its solution
       INCONSISTENT               strain, angles or specific force contradict the loads
       GAUGE_MISFIT               one gauge alone explains a misfit that chi-square does not show
       COEFFICIENTS_OUTSIDE       of a linear map, after SUSPECT: a faulty gauge moves the coefficients too
       DEGRADED                   the loads hold with the standard deviations stated, which have grown

   docs/explanation/envelope.md, "What is compared", has the conditions with their limits; a test compares the order of both
   and the names with HealthState in strainfmu/estimator/health.py. */

#include "sample.h"

const char *const HEALTH_NAMES[] = {
    "OK", "INCONSISTENT", "NO_COEFFICIENTS", "INVALID", "DEGRADED", "UNIDENTIFIED", "SUSPECT", "OUTSIDE",
};

#define CONDITION_STATE(condition, state) state,

int health_state(int conditions) {
    static const int STATES[N_CONDITIONS] = {CONDITIONS(CONDITION_STATE)};
    for (size_t k = 0; k < N_CONDITIONS; k++) {
        if (conditions & 1 << k) {
            return STATES[k];
        }
    }
    return OK;
}
