/* Derivatives of air data and their deviations: flight_air_data.c has the formulas. */

#include "../numerics/dual.h"
#include "flight_derivative.h"

static const double PI = 3.1415926535897931;

typedef Dual Row[N_STATES];

/* The angles' derivatives by u and w, in rows. */
static void set_angles(const Flight *flight, const Dual *state, Row *row) {
    const double least = flight->map.tables.min_incidence;
    const Dual x[2] = {state[STATE_U], state[STATE_W]};
    const Dual squares = dual_sum(1.0, dual_product(x[0], x[0]), 1.0, dual_product(x[1], x[1]));
    const Dual incidence = dual_root(dual_sum(1.0, squares, 1.0, dual(least * least, 0.0)));
    double s, c;
    sine_cosine(incidence.value, &s, &c);
    const Dual sine = dual(s, c * incidence.change), along = dual(c, -s * incidence.change);
    const Dual across = dual_ratio(sine, incidence);
    const Dual slope = dual_ratio(dual_sum(1.0, along, -1.0, across), incidence);
    const Dual y = dual_product(across, x[1]), z = dual_product(across, x[0]), one = dual(1.0, 0.0);
    const Dual plane = dual_sum(1.0, dual_product(along, along), 1.0, dual_product(z, z));
    const Dual other = dual_root(dual_sum(1.0, one, -1.0, dual_product(y, y)));
    for (int k = 0; k < 2; k++) {
        const Dual part = dual_ratio(x[k], incidence), bend = dual_product(slope, part);
        const Dual by_along = dual_sum(-1.0, dual_product(sine, part), 0.0, one);
        const Dual by_z = dual_sum(1.0, dual_product(bend, x[0]), k == 0 ? 1.0 : 0.0, across);
        const Dual by_y = dual_sum(1.0, dual_product(bend, x[1]), k == 1 ? 1.0 : 0.0, across);
        const Dual turn = dual_sum(1.0, dual_product(along, by_z), -1.0, dual_product(z, by_along));
        row[ANGLE_OF_ATTACK][STATE_U + k] = dual_ratio(turn, plane);
        row[SIDESLIP_ANGLE][STATE_U + k] = dual_sum(-1.0, dual_ratio(by_y, other), 0.0, one);
        row[TOTAL_INCIDENCE][STATE_U + k] = part;
    }
    const Dual square = dual_product(incidence, incidence);
    row[WIND_ROLL_ANGLE][STATE_U] = dual_sum(-1.0, dual_ratio(x[1], square), 0.0, one);
    row[WIND_ROLL_ANGLE][STATE_W] = dual_ratio(x[0], square);
}

static Dual variance_of(const Solution *found, const SolutionChange *change, const Dual *row) {
    Dual sum = {0.0, 0.0};
    for (size_t i = 0; i < N_STATES; i++) {
        for (size_t j = 0; j < N_STATES; j++) {
            const size_t at = i * N_STATES + j;
            const Dual error = dual(found->state_covariance[at], change->state_covariance[at]);
            sum = dual_sum(1.0, sum, 1.0, dual_product(dual_product(row[i], error), row[j]));
        }
    }
    return sum;
}

void derive_air_data(const Flight *flight, const SolutionChange *change, double *d_real) {
    const Solution *found = &flight->solver.solution;
    Dual state[N_STATES], row[N_AIR_DATA][N_STATES] = {{{0.0, 0.0}}};
    for (size_t k = 0; k < N_STATES; k++) {
        state[k] = dual(found->state[k], change->state[k]);
    }
    const double p = flight->real[AIR_PRESSURE];
    const Dual pressure = dual(p, p * change->state[STATE_PRESSURE]);
    const Dual square = dual_product(state[STATE_MACH], state[STATE_MACH]);
    const Dual dynamic = dual_sum(flight->map.half_gamma, dual_product(square, pressure), 0.0, pressure);
    set_angles(flight, state, row);
    row[AIR_MACH_NUMBER][STATE_MACH] = dual(1.0, 0.0);
    row[AIR_PRESSURE][STATE_PRESSURE] = pressure;
    row[AIR_DYNAMIC][STATE_MACH] = dual_sum(2.0, dual_ratio(dynamic, state[STATE_MACH]), 0.0, dynamic);
    row[AIR_DYNAMIC][STATE_PRESSURE] = dynamic;
    for (int i = 0; i < N_AIR_DATA; i++) {
        Dual std = dual_root(variance_of(found, change, row[i]));
        d_real[i] = 0.0;
        for (size_t k = 0; k < N_STATES; k++) {
            d_real[i] += row[i][k].value * change->state[k];
        }
        if (i >= AIR_PRESSURE) {
            const Dual value = i == AIR_PRESSURE ? pressure : dynamic, of_log = dual_ratio(std, value);
            const Dual wide = dual(lognormal_deviation(of_log.value), exponential(3.0 * of_log.value) * of_log.change);
            std = dual_product(value, wide);
        }
        d_real[N_AIR_DATA + i] = i == WIND_ROLL_ANGLE && std.value >= PI / sqrt(3.0) ? 0.0 : std.change;
    }
}
