/* Flight states that fit about as well as the estimated one, where air data give no pressure: how much wider
   standard deviations are.

   Strain is nearly in proportion to p_inf times incidence. Without p_inf and q_inf the valley of the cost is long
   and curved, and the covariance of the linearised problem is too small. Three more states are examined: to both
   sides of the estimate at ASIDE = 3 standard deviations of ln p_inf (LARGEST_ASIDE at most), with M, u, w solved
   there by ASIDE_ITERATIONS iterations, and the farthest end of the search. With the excess D of -2 ln likelihood
   there, the difference delta of an output and its remaining variance v there, the variance of the output is at
   least

       v + delta^2 / max(D, LEAST_EXCESS),

   fully up to D = 16, not at all from 25 on (UNLIKELY), linearly between: a state at three standard deviations of a
   Gaussian has D = 9 and delta^2 / D = 1 standard deviation squared. For an end of the search the weight also asks
   for a distance that its excess does not explain, delta_x' H delta_x - D (UNEXPLAINED): in a Gaussian the two are
   equal.

   The results are factors on standard deviations (N_WIDENING: state, loads, coefficients). A covariance C is widened
   as C_ij min(w_i, w_j)^2, by which no combination of outputs becomes more certain: it is C plus sums of positive
   matrices. The factors of a search hold for the steps after it. docs/explanation/nonlinear_estimator.md, "Without
   q_inf and p_inf". */

#include "ambiguity.h"

#include <math.h>
#include <string.h>

#include "../nonlinear/flight_loads.h"
#include "../nonlinear/flight_search.h"
#include "../nonlinear/flight_solve.h"
#include "../numerics/cholesky.h"

/* Limits in chi-square and in standard deviations: docs/explanation/nonlinear_estimator.md. */
#define KNOWN_PRECISION 100.0
#define ASIDE 3.0
#define LARGEST_ASIDE 3.0
#define LEAST_EXCESS 4.0
static const double UNLIKELY[2] = {16.0, 25.0}, UNEXPLAINED[2] = {4.0, 9.0};

#define N_INNER STATE_PRESSURE /* Mach number, u and w; ln p_inf is the last of the state */

/* State, loads and coefficients at a flight state. */
typedef struct {
    double value[N_WIDENING], variance[N_WIDENING], deviance;
} Estimated;

int flight_pressure_unknown(const FlightSolver *solver) {
    return solver->sample.precision[1] + solver->sample.precision[2] < KNOWN_PRECISION;
}

/* C_ij min(w_i, w_j)^2. */
static void widen(size_t order, const double *widening, double *covariance) {
    for (size_t i = 0; i < order; i++) {
        for (size_t j = 0; j < order; j++) {
            const double factor = widening[i] < widening[j] ? widening[i] : widening[j];
            covariance[i * order + j] *= factor * factor;
        }
    }
}

void flight_widen(FlightSolver *solver, const double *widening) {
    Solution *solution = &solver->solution;
    memcpy(solution->widening, widening, sizeof solution->widening);
    widen(N_STATES, widening, solution->widened_covariance);
    widen(N_LOADS, widening + N_STATES, solution->load_covariance);
    widen(N_LOADS, widening + N_STATES + N_LOADS, solution->coefficient_covariance);
}

/* 0 below the first of the ends, 1 above the second, between them a straight line. */
static double risen(double value, const double *ends) {
    return clipped((value - ends[0]) / (ends[1] - ends[0]), 0.0, 1.0);
}

double flight_weight_of_excess(double excess) {
    return 1.0 - risen(excess, UNLIKELY);
}

/* Outputs and variances at the state of the problem, of which the first n_free elements are free, and its -2 ln
   likelihood. */
static void estimate(FlightSolver *solver, size_t n_free, Estimated *estimated) {
    const Solution *solution = &solver->solution;
    flight_weigh_full(solver, n_free);
    flight_set_loads(solver);
    for (size_t k = 0; k < N_STATES; k++) {
        estimated->value[k] = solver->state[k];
        estimated->variance[k] = solution->widened_covariance[k * (N_STATES + 1)];
    }
    for (size_t i = 0; i < N_LOADS; i++) {
        estimated->value[N_STATES + i] = solution->loads[i];
        estimated->variance[N_STATES + i] = solution->load_covariance[i * (N_LOADS + 1)];
        estimated->value[N_STATES + N_LOADS + i] = solution->coefficients[i];
        estimated->variance[N_STATES + N_LOADS + i] = solution->coefficient_covariance[i * (N_LOADS + 1)];
    }
    estimated->deviance = flight_deviance(solver);
}

/* Enlarge variances to what another state, of a weight, needs: v + part delta^2. */
static void enlarge(const Estimated *base, const Estimated *other, double weight, double part, double *largest) {
    for (size_t i = 0; i < N_WIDENING; i++) {
        const double apart = other->value[i] - base->value[i];
        const double variance = other->variance[i] + part * (apart * apart);
        const double larger = base->variance[i] + weight * (variance - base->variance[i]);
        largest[i] = larger > largest[i] ? larger : largest[i];
    }
}

/* The inverse of H without ln p_inf: M, u, w at a given pressure. */
static void invert_inner(const FlightSolver *solver, double inverse[N_INNER * N_INNER]) {
    double inner[N_INNER * N_INNER];
    for (size_t i = 0; i < N_INNER; i++) {
        memcpy(inner + i * N_INNER, solver->hessian + i * N_STATES, N_INNER * sizeof *inner);
    }
    invert_small(N_INNER, inner, inverse);
}

/* The state to one side: along the covariance with ln p_inf first, which is the direction of the valley, then M, u,
   w are solved at that pressure. */
static void look_aside(FlightSolver *solver, const double *state, const double *covariance, const Estimated *base,
                       double sign, double *largest) {
    static const double NONE[N_STATES] = {0.0};
    const double own = covariance[STATE_PRESSURE * (N_STATES + 1)], three = ASIDE * sqrt(own);
    const double size = sign * (three < LARGEST_ASIDE ? three : LARGEST_ASIDE) / own;
    double next[N_STATES], step[N_STATES] = {0.0}, inverse[N_INNER * N_INNER];
    for (size_t k = 0; k < N_STATES; k++) {
        next[k] = state[k] + size * covariance[k * N_STATES + STATE_PRESSURE];
    }
    flight_limited(solver->map, next, NONE, next);
    flight_linearise_anew(solver, next);
    for (int iteration = 0; iteration < ASIDE_ITERATIONS; iteration++) {
        solver->iterations++;
        invert_inner(solver, inverse);
        for (size_t i = 0; i < N_INNER; i++) {
            step[i] = 0.0;
            for (size_t j = 0; j < N_INNER; j++) {
                step[i] += inverse[i * N_INNER + j] * solver->gradient[j];
            }
        }
        flight_limited(solver->map, solver->state, step, next);
        flight_linearise_anew(solver, next);
    }
    Estimated other;
    estimate(solver, N_INNER, &other); /* for ln p_inf the error is the distance itself */
    const double excess = other.deviance - base->deviance;
    enlarge(base, &other, flight_weight_of_excess(excess), 1.0 / (excess > LEAST_EXCESS ? excess : LEAST_EXCESS), largest);
}

/* The weight of an end of the search, and the square of its distance from a state with a Hessian. */
static double weight_of_end(const double *state, const double *hessian, const double *end, double excess,
                            double *square) {
    double apart[N_STATES];
    for (size_t k = 0; k < N_STATES; k++) {
        apart[k] = end[k] - state[k];
    }
    *square = quadratic(N_STATES, apart, hessian, apart);
    return risen(*square - (excess > 0.0 ? excess : 0.0), UNEXPLAINED) * flight_weight_of_excess(excess);
}

/* The farthest of the states at which the search ended that fits. */
static void look_at_ends(FlightSolver *solver, const double *state, const double *hessian, const Estimated *base,
                         double *largest) {
    size_t farthest = 0;
    double most = 0.0, square;
    for (size_t s = 0; s < SEARCH_STARTS; s++) {
        const double weight =
            weight_of_end(state, hessian, solver->end[s], solver->end_deviance[s] - base->deviance, &square);
        if (weight > 0.0 && weight * square > most) {
            most = weight * square;
            farthest = s;
        }
    }
    if (!(most > 0.0)) {
        return;
    }
    Estimated other;
    /* The end was reached with S of half-way: its likelihood by S there decides. */
    flight_linearise_anew(solver, solver->end[farthest]);
    estimate(solver, N_STATES, &other);
    const double weight =
        weight_of_end(state, hessian, solver->state, other.deviance - base->deviance, &square);
    enlarge(base, &other, weight, 1.0 / LEAST_EXCESS, largest);
}

/* The factors at the state of the problem, which is weighted by S there; afterwards the problem is at another state. */
static void find_widening(FlightSolver *solver, double *widening) {
    double state[N_STATES], hessian[N_STATES * N_STATES], covariance[N_STATES * N_STATES], largest[N_WIDENING];
    Estimated base;
    memcpy(state, solver->state, sizeof state);
    memcpy(hessian, solver->hessian, sizeof hessian);
    invert_small(N_STATES, hessian, covariance);
    estimate(solver, N_STATES, &base);
    memcpy(largest, base.variance, sizeof largest);
    look_aside(solver, state, covariance, &base, 1.0, largest);
    look_aside(solver, state, covariance, &base, -1.0, largest);
    look_at_ends(solver, state, hessian, &base, largest);
    for (size_t i = 0; i < N_WIDENING; i++) {
        const double ratio = largest[i] / base.variance[i];
        widening[i] = ratio > 1.0 && isfinite(ratio) ? sqrt(ratio) : 1.0;
    }
}

void flight_widen_searched(FlightSolver *solver) {
    double state[N_STATES], widening[N_WIDENING];
    memcpy(state, solver->state, sizeof state);
    find_widening(solver, widening);
    flight_solve_again(solver, state, state);
    flight_widen(solver, widening);
}

void flight_search_more(FlightSolver *solver) {
    double widening[N_WIDENING], state[N_STATES], weighted_at[N_STATES];
    memcpy(state, solver->state, sizeof state);
    memcpy(weighted_at, solver->factor_state, sizeof weighted_at);
    const size_t best = flight_search_ends(solver);
    flight_linearise_anew(solver, state);
    if (flight_search_kept(solver) && solver->end_deviance[best] < flight_deviance(solver) - BETTER) {
        flight_solve_from(solver, solver->end[best]);
        flight_widen_searched(solver);
        return;
    }
    find_widening(solver, widening);
    flight_solve_again(solver, weighted_at, state);
    flight_widen(solver, widening);
}
