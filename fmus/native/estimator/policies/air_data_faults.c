/* Air data that fit neither strain nor each other: which one is dropped, and which are doubted.

   z_k (3) are standardised residuals of M, ln p_inf, ln q_inf against strain and the others (flight_solve.c). The
   one of largest |z_k| / limit_k, where that is above 1, is dropped: its precision becomes 0, and the sample is
   solved again. Which of them is wrong is not certain where |z| of the dropped one is no alarm yet, or where another
   one explains nearly as much, z_dropped^2 - z_k^2 < DISCERNED. Then the others count with standard deviations
   |z_dropped| + 1 times as large, that is precision / (|z| + 1)^2, so that three standard deviations of the loads
   include either case; the 1 is the noise in z.

   A static pressure from which q_inf was computed is confirmed by nothing. From |z| > UNLIKELY_PRESSURE on it counts
   with a standard deviation |z| + 1 times as large. docs/explanation/nonlinear_estimator.md, "What comes out";
   without and doubted in strainfmu/estimator/reference/air.py. */

#include "air_data_faults.h"

#include <math.h>

/* Difference of two sums of squares from which the quantity that leaves the larger one is not the wrong one. */
#define DISCERNED 16.0

/* Standardised residual from which a static pressure that nothing confirms is doubted. */
#define UNLIKELY_PRESSURE 1.5

/* Whether another quantity may be the wrong one, or none, where one is dropped; of their residuals. */
static int navigation_may_be_wrong(const Flight *flight, double dropped, double other) {
    return fabs(dropped) <= flight->map.navigation_alarm || dropped * dropped - other * other < DISCERNED;
}

/* Doubt a static pressure that no other measurement confirms and strain makes unlikely; whether it is. */
static int doubt_unconfirmed(Flight *flight) {
    const double size = fabs(flight->solver.solution.navigation_residual[1]), factor = size + 1.0;
    if (!flight->navigation.is_computed || !(size > UNLIKELY_PRESSURE)) {
        return 0;
    }
    flight->solver.sample.precision[1] /= factor * factor;
    return 1;
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
    double *precision = flight->solver.sample.precision;
    if (!(largest > 1.0)) {
        return doubt_unconfirmed(flight);
    }
    for (size_t k = 0; k < N_NAVIGATION; k++) {
        const double widening =
            navigation_may_be_wrong(flight, residual[worst], residual[k]) ? fabs(residual[worst]) + 1.0 : 1.0;
        precision[k] = k == worst ? 0.0 : precision[k] / (widening * widening);
    }
    return 1;
}

/* Whether a value that is given is not used, other than one whose residual is small enough to be a correct one. */
int flight_navigation_alarms(const Flight *flight) {
    int alarms = 0;
    for (size_t k = 0; k < N_NAVIGATION; k++) {
        const double size = fabs(flight->solver.solution.navigation_residual[k]);
        const int may_be_correct = size > 0.0 && size <= flight->map.navigation_alarm;
        alarms |= !isnan(flight->navigation.value[k]) && !(flight->solver.sample.precision[k] > 0.0) && !may_be_correct;
    }
    return alarms;
}

size_t flight_navigation_used(const Flight *flight) {
    size_t count = 0;
    for (size_t k = 0; k < N_NAVIGATION; k++) {
        count += flight->solver.sample.precision[k] > 0.0;
    }
    return count;
}
