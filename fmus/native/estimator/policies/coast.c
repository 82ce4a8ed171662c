/* Steps without any strain: the last filtered estimate stays, and its standard deviations grow with the time since
   then.

   The flight state x (4) may have moved by the spread t sqrt(rate_k^2 + seen_k^2) in each part, rate the standard
   deviations of rates that the map allows, seen the rates of the last windows. With the slopes J_L of the tables,
   the variance of a load and of its coefficient grows by

       sum over k of (J_Lk spread_k)^2,      sum over k of ((scale J_Lk - C d ln q/dx_k) spread_k)^2,

   slopes at the largest incidence within the spread, where they are largest: the estimate must not become certain
   because it happened to be at zero incidence. Once the state is no longer identified against the ranges of the map,
   nothing is known. docs/explanation/filter.md, "What does not fit". */

#include "coast.h"

#include <math.h>

#include "../nonlinear/flight_solve.h"
#include "../numerics/cholesky.h"
#include "flight_outputs.h"

/* How far the flight state may have moved, in standard deviations of each part. */
static void set_spread(const Filter *filter, double time, double spread[N_STATES]) {
    for (size_t k = 0; k < N_STATES; k++) {
        const double allowed = filter->map.rate[k], seen = filter->last_rate[STATE_CHANNELS + k];
        spread[k] = time * sqrt(allowed * allowed + seen * seen);
    }
}

/* The flight state whose slopes count: at the largest incidence of the spread, where they are the largest. */
static void set_slope_state(const Flight *flight, const double *state, const double *spread, double *outer) {
    static const double NONE[N_STATES] = {0.0};
    const double u = state[STATE_U], w = state[STATE_W], incidence = sqrt(u * u + w * w);
    const double reach = sqrt(spread[STATE_U] * spread[STATE_U] + spread[STATE_W] * spread[STATE_W]);
    const double limit = flight->map.incidence_limit, more = reach < limit ? reach : limit;
    memcpy(outer, state, N_STATES * sizeof *outer);
    outer[STATE_U] += incidence > 0.0 ? more * (u / incidence) : more;
    outer[STATE_W] += incidence > 0.0 ? more * (w / incidence) : 0.0;
    flight_limited(&flight->map, outer, NONE, outer);
}

static double square_of_spread(const double *slope, const double *spread) {
    double sum = 0.0;
    for (size_t k = 0; k < N_STATES; k++) {
        sum += (slope[k] * spread[k]) * (slope[k] * spread[k]);
    }
    return sum;
}

/* The two sums above, added to the variances of the last filtered sample. */
static void set_variances(const Filter *filter, size_t load, size_t coefficient, const double *slope, double scale,
                          const double *by_pressure, const double *spread, double variance[2]) {
    double of_coefficient[N_STATES];
    for (size_t k = 0; k < N_STATES; k++) {
        of_coefficient[k] = scale * slope[k] - filter->last_value[coefficient] * by_pressure[k];
    }
    variance[0] = filter->last_variance[load] + square_of_spread(slope, spread);
    variance[1] = filter->last_variance[coefficient] + square_of_spread(of_coefficient, spread);
}

static void set_loads(Flight *flight, const Filter *filter, const double *by_pressure, const double *scale,
                      const double *spread) {
    const Response *response = &flight->solver.response;
    const double shift = moment_shift(flight->inputs);
    for (size_t i = 0; i < N_LOADS; i++) {
        const size_t row = flight->solver.n_gauges + i;
        double slope[N_STATES], variance[2];
        for (size_t k = 0; k < N_STATES; k++) {
            slope[k] = response->jacobian[k][row] + (i >= 3 ? shift * response->jacobian[k][row - 2] : 0.0);
        }
        set_variances(filter, LOAD_CHANNELS + i, COEFFICIENT_CHANNELS + i, slope, scale[i], by_pressure, spread, variance);
        flight->output[LOADS + i] = filter->last_value[LOAD_CHANNELS + i];
        flight->output[COEFFICIENTS + i] = filter->last_value[COEFFICIENT_CHANNELS + i];
        flight->output[LOADS_STD + i] = sqrt(variance[0]);
        flight->output[COEFFICIENTS_STD + i] = sqrt(variance[1]);
    }
}

static void set_other_loads(Flight *flight, const Filter *filter, const double *outer, const double *by_pressure,
                            const double *scale, const double *spread) {
    OtherLoads *out = flight->loads;
    FlightOtherLoads *tables = &flight->other_loads;
    const size_t m = out->map.n_loads, first = STATE_CHANNELS + N_STATES;
    if (m == 0) {
        return;
    }
    flight_response(&tables->tables, flight->solver.wide, outer, &tables->response);
    for (size_t j = 0; j < m; j++) {
        double slope[N_STATES], variance[2];
        for (size_t k = 0; k < N_STATES; k++) {
            slope[k] = tables->response.jacobian[k][j];
        }
        set_variances(filter, first + j, first + m + j, slope, scale[out->map.is_moment[j] > 0.0 ? 3 : 0], by_pressure,
                      spread, variance);
        out->value[OTHER_LOADS][j] = filter->last_value[first + j];
        out->value[OTHER_COEFFICIENTS][j] = filter->last_value[first + m + j];
        out->value[OTHER_LOADS_STD][j] = sqrt(variance[0]);
        out->value[OTHER_COEFFICIENTS_STD][j] = sqrt(variance[1]);
    }
    out->outdated = 0;
}

void flight_coast(Flight *flight, Filter *filter, double time) {
    const double *state = filter->last_value + STATE_CHANNELS, *scalar = flight->inputs->value + flight->solver.n_gauges;
    Solution *solution = &flight->solver.solution;
    double spread[N_STATES], outer[N_STATES], scale[N_LOADS];
    set_spread(filter, time, spread);
    memcpy(solution->state, state, sizeof solution->state);
    memset(solution->widened_covariance, 0, sizeof solution->widened_covariance);
    for (size_t k = 0; k < N_STATES; k++) {
        solution->widened_covariance[k * (N_STATES + 1)] =
            filter->last_variance[STATE_CHANNELS + k] + spread[k] * spread[k];
    }
    flight_air_data(&flight->map, flight->prior_std, solution, flight->real, flight->flag);
    memset(flight->flag + NAVIGATION_USED, 0, N_FLIGHT_FLAGS - NAVIGATION_USED);
    if (!flight->flag[TOTAL_INCIDENCE]) {
        flight_set_nothing_known(flight, NO_GAUGE);
        return;
    }
    const double by_pressure[N_STATES] = {2.0 / flight->real[AIR_MACH_NUMBER], 0.0, 0.0, 1.0};
    set_slope_state(flight, state, spread, outer);
    flight_response(&flight->solver.tables, flight->solver.wide, outer, &flight->solver.response);
    coefficient_scales(flight->real[AIR_DYNAMIC], scalar[REFERENCE_AREA], scalar[REFERENCE_LENGTH], scale);
    set_loads(flight, filter, by_pressure, scale, spread);
    set_other_loads(flight, filter, outer, by_pressure, scale, spread);
    flight->conditions = FILTER_HOLDS;
    filter->coasts = 1;
}
