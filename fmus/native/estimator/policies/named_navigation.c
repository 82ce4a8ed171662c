#include "named_navigation.h"

#include <math.h>

#include "../nonlinear/flight_solve.h"
#include "../numerics/cholesky.h"

void filter_leave_out_named(Filter *filter) {
    double *precision = filter->solver->sample.precision;
    memcpy(filter->given, precision, sizeof filter->given);
    for (size_t k = 0; k < N_NAVIGATION; k++) {
        precision[k] = filter->base.apart[k] > 0.0 ? 0.0 : precision[k];
    }
}

void filter_judge(Filter *filter, double residual[N_NAVIGATION]) {
    const FlightSolver *solver = filter->solver;
    const Law *law = &filter->laws.next_law;
    const double white = filter->map.white_navigation, lasting = sqrt(1.0 - white);
    for (size_t k = 0; k < N_NAVIGATION; k++) {
        const double apart = filter->base.apart[k], scale = sqrt(filter->given[k]);
        const size_t own = FIRST_NAVIGATION + k;
        const double *error = law->covariance + own * filter->laws.order;
        const int left_out = scale > 0.0 && !(solver->sample.precision[k] > 0.0);
        double row[N_STATES], state[N_STATES * N_STATES], variance = white + lasting * lasting * error[own];
        flight_measurement_row(solver->log_mach_slope, k, row);
        for (size_t i = 0; i < N_STATES; i++) {
            row[i] *= scale;
            memcpy(state + i * N_STATES, law->covariance + i * filter->laws.order, N_STATES * sizeof *state);
            variance += 2.0 * lasting * row[i] * error[i];
        }
        const double std = sqrt(variance + quadratic(N_STATES, row, state, row));
        const double innovation = scale * solver->innovation[k] - lasting * law->mean[own];
        const double distance = left_out ? innovation / std : 0.0;
        const double alarm = solver->map->navigation_alarm;
        if (apart > 0.0) {
            const int good = left_out && fabs(distance) <= filter->map.fits && apart > (alarm + filter->map.fits) * std;
            residual[k] = distance;
            filter->next.apart[k] = good ? 0.0 : apart;
            filter->next.alarms[k] = 0.0;
        } else {
            const double side = distance > alarm ? 1.0 : distance < -alarm ? -1.0 : 0.0, before = filter->base.alarms[k];
            const double alarms = (side * before > 0.0 ? before : 0.0) + side;
            const int named = fabs(alarms) >= filter->map.named_after;
            filter->next.apart[k] = named ? fabs(innovation) : 0.0;
            filter->next.alarms[k] = named ? 0.0 : alarms;
        }
    }
}

void filter_keep_named(Filter *filter) {
    memcpy(filter->next.apart, filter->base.apart, sizeof filter->next.apart);
    memcpy(filter->next.alarms, filter->base.alarms, sizeof filter->next.alarms);
}
