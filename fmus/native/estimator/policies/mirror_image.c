#include "mirror_image.h"

#include <math.h>
#include <string.h>

#include "../nonlinear/flight_solve.h"
#include "../numerics/cholesky.h"
#include "ambiguity.h"

/* Squares of distances in strain, in standard deviations: from the first on two images are distinct without an iteration,
   from the second on by what the first iteration can reach. A mirror image counts wholly up to an excess of -2 ln
   likelihood of UNLIKELY[0], and not at all from UNLIKELY[1] on. From BETTER on it takes the place of the solution. */
#define DISTINCT 1e3
#define PREDICTED 1e2
#define BETTER 9.0
static const double UNLIKELY[2] = {16.0, 25.0};

/* Part of the square of a difference that counts as variance: three standard deviations reach half of it beyond. */
#define PART 0.25

/* Reflections of (u, w) in a plane through the axis. */
typedef struct {
    double cosine, sine; /* of twice its roll angle */
} Plane;

static void reflect(const Plane *plane, const double *state, double *image) {
    memcpy(image, state, N_STATES * sizeof *image);
    image[STATE_U] = plane->cosine * state[STATE_U] + plane->sine * state[STATE_W];
    image[STATE_W] = plane->sine * state[STATE_U] - plane->cosine * state[STATE_W];
}

static int gauges_are_lost(const FlightSolver *solver) {
    size_t lost = 0;
    for (size_t g = 0; g < solver->n_gauges; g++) {
        lost += !solver->sample.used[g];
    }
    return lost > 0;
}

/* The plane that the gauges in use are nearest to: across it they hold the minimum information on the crossflow, which is
   *across per square of p_inf and radian. Its normal is an eigenvector of the information's matrix; the reflection follows
   from the matrix without it. 0 where they hold as much along it. */
static int nearest_plane(const FlightSolver *solver, Plane *plane, double *across) {
    double of_u = 0.0, of_w = 0.0, of_both = 0.0;
    for (size_t g = 0; g < solver->n_gauges; g++) {
        const double weight = solver->sample.used[g] ? solver->search_weight[g] : 0.0;
        const double by_u = weight * solver->search_slope[0][g], by_w = weight * solver->search_slope[1][g];
        of_u += by_u * by_u;
        of_w += by_w * by_w;
        of_both += by_u * by_w;
    }
    const double difference = 0.5 * (of_u - of_w), radius = sqrt(difference * difference + of_both * of_both);
    *across = 0.5 * (of_u + of_w) - radius;
    if (!(radius > 0.0)) {
        return 0;
    }
    *plane = (Plane){difference / radius, of_both / radius};
    return 1;
}

/* Whether gauges read a state and its image so differently that no iteration is needed. */
static int are_distinct(const FlightSolver *solver, const double *state, const double *image, double across) {
    const double u = image[STATE_U] - state[STATE_U], w = image[STATE_W] - state[STATE_W];
    const double pressure = solver->response.pressure;
    return pressure * pressure * across * (u * u + w * w) > DISTINCT;
}

/* Whether the first iteration from an image may reach what the solution costs. */
static int may_fit(FlightSolver *solver, const double *image) {
    double inverse[N_STATES * N_STATES];
    const double cost = solver->cost;
    flight_linearise_at(solver, image);
    invert_small(N_STATES, solver->hessian, inverse);
    const double gained = quadratic(N_STATES, solver->gradient, inverse, solver->gradient);
    return solver->cost - gained < cost + PREDICTED;
}

/* 1 below the first of UNLIKELY, 0 above the second. */
static double weight_of(double excess) {
    return 1.0 - clipped((excess - UNLIKELY[0]) / (UNLIKELY[1] - UNLIKELY[0]), 0.0, 1.0);
}

static void add_difference(size_t order, double part, const double *value, const double *image, double *covariance) {
    for (size_t i = 0; i < order; i++) {
        for (size_t j = 0; j < order; j++) {
            covariance[i * order + j] += part * ((image[i] - value[i]) * (image[j] - value[j]));
        }
    }
}

/* Have a solution again that was weighted by S at another state, with its widening. */
static void have_again(FlightSolver *solver, const double *weighted_at, const double *state, const double *widening) {
    flight_solve_again(solver, weighted_at, state);
    if (widening[0] != 0.0) {
        flight_widen(solver, widening);
    }
}

void flight_look_at_mirror_image(FlightSolver *solver) {
    Solution *found = &solver->solution;
    Plane plane;
    double image[N_STATES], across;
    if (!gauges_are_lost(solver) || !nearest_plane(solver, &plane, &across)) {
        return;
    }
    reflect(&plane, found->state, image);
    if (are_distinct(solver, found->state, image, across)) {
        return;
    }
    double state[N_STATES], weighted_at[N_STATES], widening[N_WIDENING], residual[N_NAVIGATION];
    memcpy(state, found->state, sizeof state);
    memcpy(weighted_at, solver->factor_state, sizeof weighted_at);
    memcpy(widening, found->widening, sizeof widening);
    memcpy(residual, found->navigation_residual, sizeof residual);
    double weight = 0.0, loads[N_LOADS], coefficients[N_LOADS];
    if (may_fit(solver, image)) {
        flight_linearise_anew(solver, state);
        const double own = flight_deviance(solver);
        const double excess = flight_iterate_start(solver, image) - own;
        if (excess < -BETTER) {
            double kept[N_STATES];
            memcpy(kept, image, sizeof kept);
            memcpy(image, state, sizeof image);
            memcpy(state, kept, sizeof state);
            memcpy(weighted_at, kept, sizeof weighted_at);
        }
        weight = weight_of(fabs(excess));
    }
    if (weight > 0.0) {
        flight_linearise_anew(solver, image);
        flight_settle(solver);
        memcpy(loads, found->loads, sizeof loads);
        memcpy(coefficients, found->coefficients, sizeof coefficients);
    }
    have_again(solver, weighted_at, state, widening);
    memcpy(found->navigation_residual, residual, sizeof residual);
    if (weight > 0.0) {
        found->mirror_part = PART * weight;
        memcpy(found->mirror_state, image, sizeof found->mirror_state);
        add_difference(N_STATES, found->mirror_part, found->state, image, found->widened_covariance);
        add_difference(N_LOADS, found->mirror_part, found->loads, loads, found->load_covariance);
        add_difference(N_LOADS, found->mirror_part, found->coefficients, coefficients, found->coefficient_covariance);
    }
}
