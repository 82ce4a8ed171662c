#include "air_data_faults.h"

#include <math.h>

/* Difference of two sums of squares from which the quantity that leaves the larger one is not the wrong one: navigation.py. */
#define DISCERNED 16.0

/* Standardised residual from which a static pressure that nothing confirms is doubted: navigation.py. */
#define UNLIKELY_PRESSURE 1.5

/* Whether another quantity of navigation may be the wrong one, or none, where one is dropped; of their residuals. */
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
