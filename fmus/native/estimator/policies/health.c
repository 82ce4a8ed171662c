/* Health of a sample: the state of the first condition that holds, from top to bottom of one table.

   The linear and the nonlinear estimator, filter, renewal and inertia note what they know of a sample as bits (conditions,
   sample/outputs.h); none of them chooses a state. The order says what explains a sample best:

       nothing can be computed    no gauge reads; the gauges in use do not identify the loads; no dynamic pressure
       FLOW_OUTSIDE               before INCONSISTENT: beyond its range a map is expected to fit badly. The nonlinear
                                  estimator includes its own flight state, which is part of its solution
       INCONSISTENT               strain, angles or specific force contradict the loads
       GAUGE_MISFIT               one gauge alone explains a misfit that chi-square does not show
       COEFFICIENTS_OUTSIDE       of a linear map, after SUSPECT: a faulty gauge moves the coefficients too
       DEGRADED                   the loads hold with the standard deviations stated, which have grown

   docs/explanation/envelope.md, "What is compared", has the conditions with their limits; a test compares the order of both
   and the names with HealthState in strainfmu/estimator/health.py. */

#include "health.h"

#include <stddef.h>

#include "../sample/outputs.h"

const char *const HEALTH_NAMES[] = {
    "OK", "INCONSISTENT", "NO_COEFFICIENTS", "INVALID", "DEGRADED", "UNIDENTIFIED", "SUSPECT", "OUTSIDE",
};

static const struct {
    int condition, state;
} ROWS[] = {
    {NO_GAUGE, INVALID},
    {FILTER_HOLDS, INVALID},
    {NOT_IDENTIFIED, UNIDENTIFIED},
    {PRESSURE_UNKNOWN, NO_COEFFICIENTS},
    {FLOW_OUTSIDE, OUTSIDE},
    {STRAIN_MISFIT, INCONSISTENT},
    {ANGLES_CONTRADICT, INCONSISTENT},
    {FORCE_CONTRADICTS, INCONSISTENT},
    {GAUGE_MISFIT, SUSPECT},
    {COEFFICIENTS_OUTSIDE, OUTSIDE},
    {GAUGES_LOST, DEGRADED},
    {AIR_DATA_LOST, DEGRADED},
    {STATE_MOVES, DEGRADED},
    {LOADS_OF_LINEAR_MAP, DEGRADED},
    {RENEWAL_PENDING, DEGRADED},
    {VIBRATES, DEGRADED},
};

int health_state(int conditions) {
    for (size_t k = 0; k < sizeof ROWS / sizeof *ROWS; k++) {
        if (conditions & ROWS[k].condition) {
            return ROWS[k].state;
        }
    }
    return OK;
}
