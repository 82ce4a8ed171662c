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

#include "policies.h"

#include <math.h>
#include <string.h>

/* Limits in chi-square and in standard deviations: docs/explanation/nonlinear_estimator.md. */
#define KNOWN_PRECISION 100.0
#define ASIDE 3.0
#define LARGEST_ASIDE 3.0
#define LEAST_EXCESS 4.0
/* Excess of -2 ln likelihood by which another state is better and takes the place of the solution. */
#define BETTER 9.0
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

/* How much another state counts by its excess. */
static double flight_weight_of_excess(double excess) {
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
        small_times(N_INNER, inverse, solver->gradient, step);
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
            weight_of_end(state, hessian, solver->ends->end[s], solver->ends->deviance[s] - base->deviance, &square);
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
    flight_linearise_anew(solver, solver->ends->end[farthest]);
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
    const KeptSolution kept = flight_keep(solver);
    double widening[N_WIDENING];
    const size_t best = flight_search_ends(solver);
    flight_linearise_anew(solver, kept.state);
    if (flight_search_kept(solver) && solver->ends->deviance[best] < flight_deviance(solver) - BETTER) {
        flight_solve_from(solver, solver->ends->end[best]);
        flight_widen_searched(solver);
        return;
    }
    find_widening(solver, widening);
    flight_take_again(solver, &kept);
    flight_widen(solver, widening);
}

/* Other flows that the gauges in use read alike where some are lost: they are looked for, and their differences
   widen the covariances.

   Gauges near one plane through the axis read a flow and its mirror image alike, and a few gauges may have several
   solutions. Starts are the best other minima of the search's grid (flight_search.c) and mirror images of the
   estimate. The plane follows from the information that the gauges in use have on the flow direction,

       N (2, 2) = sum over gauges of s_g s_g' / S_gg,      s_g = d y_g / d(u, w) at p_inf = 1 Pa,

   whose eigenvector of the smaller eigenvalue is the normal n of the plane; the mirror image of (u, w) is (u, w) - 2
   n n' (u, w). A start is iterated only if its first Gauss-Newton step leads elsewhere (leads_elsewhere) and the
   strain of both is not so different that one is out of the question (DISTINCT). With E the excess of -2 ln
   likelihood over the best, another solution at a difference delta adds

       PART weight(E) delta delta',     weight = 1 up to E = 16, 0 from 25 on,

   to the covariances: with PART = 1/4 three standard deviations reach half of delta beyond it. One that is better by
   BETTER takes the place of the solution. docs/explanation/nonlinear_estimator.md, "Lost gauges". */

/* Squares of distances, in standard deviations: of strain, from which a state and its mirror image are distinct without an
   iteration, and above which the first iteration must come; of states, up to which two are the same. */
#define DISTINCT 1e3
#define PREDICTED 1e2
#define SAME 0.1

/* Part of the square of a difference that counts as variance: three standard deviations reach half of it beyond. */
#define PART 0.25

/* Solutions of a sample; the first is the one that was found. */
typedef struct {
    size_t count;
    double state[1 + MOST_OTHERS][N_STATES], deviance[1 + MOST_OTHERS];
} Solutions;

int flight_gauges_are_lost(const FlightSolver *solver) {
    size_t lost = 0;
    for (size_t g = 0; g < solver->n_gauges; g++) {
        lost += !solver->sample.used[g];
    }
    return lost > 0;
}

/* Eigenvalues of N, the smaller one first, and the unit normal that belongs to it. 0 where N is a multiple of the
   unit matrix: every plane is as near. */
static int nearest_plane(const FlightSolver *solver, double normal[2], double information[2]) {
    double of_u = 0.0, of_w = 0.0, of_both = 0.0;
    for (size_t g = 0; g < solver->n_gauges; g++) {
        const double weight = solver->sample.used[g] ? solver->search_weight[g] : 0.0;
        const double by_u = weight * solver->search_slope[0][g], by_w = weight * solver->search_slope[1][g];
        of_u += by_u * by_u;
        of_w += by_w * by_w;
        of_both += by_u * by_w;
    }
    const double difference = 0.5 * (of_u - of_w), radius = sqrt(difference * difference + of_both * of_both);
    if (!(radius > 0.0)) {
        return 0;
    }
    /* Half of the angle 2 phi of the eigenvector, by cos phi = sqrt((1 + |cos 2 phi|) / 2): no difference cancels. */
    const double cosine = difference / radius, sine = of_both / radius; /* of twice the plane's roll angle */
    const double larger = sqrt(0.5 * (1.0 + fabs(cosine))), smaller = -0.5 * sine / larger;
    normal[0] = cosine < 0.0 ? larger : smaller;
    normal[1] = cosine < 0.0 ? smaller : larger;
    information[0] = 0.5 * (of_u + of_w) - radius;
    information[1] = 0.5 * (of_u + of_w) + radius;
    return 1;
}

/* The distance [rad] from a plane up to which a state is next to it: half of that between two incidences of the search. */
static double next_to_plane(const FlightMap *map) {
    const double *half = map->crossflow_half;
    return 0.5 * (half[0] < half[1] ? half[0] : half[1]) / SEARCH_STARTS;
}

/* Mirror images of a state about the plane of a normal; their number. Next to the plane, where iterations that have
   come upon it stay, there is one start on each side. */
static size_t image_starts(const FlightSolver *solver, const double *state, const double normal[2], double information,
                           double start[][N_STATES]) {
    const double near = next_to_plane(solver->map), pressure = solver->response.pressure;
    const double off = normal[0] * state[STATE_U] + normal[1] * state[STATE_W];
    const double reach = fabs(off) > near ? fabs(off) : near;
    if (pressure * pressure * information * (4.0 * reach * reach) > DISTINCT) {
        return 0;
    }
    const size_t count = fabs(off) > near ? 1 : 2;
    for (size_t s = 0; s < count; s++) {
        const double to = count == 1 ? -off : s == 0 ? near : -near;
        memcpy(start[s], state, N_STATES * sizeof *state);
        start[s][STATE_U] += (to - off) * normal[0];
        start[s][STATE_W] += (to - off) * normal[1];
    }
    return count;
}

static size_t mirror_starts(const FlightSolver *solver, const double *state, double start[][N_STATES]) {
    double normal[2], information[2];
    if (!nearest_plane(solver, normal, information)) {
        return 0;
    }
    const double across[2] = {-normal[1], normal[0]};
    const size_t count = image_starts(solver, state, normal, information[0], start);
    return count + image_starts(solver, state, across, information[1], start + count);
}

/* Whether iterations from a start may end in another solution of about the same cost. The first step decides: it has
   to lead to a place that is farther from the estimate than from the start, and not next to a plane. */
static int leads_elsewhere(FlightSolver *solver, const double *start, const double *state, double cost) {
    double inverse[N_STATES * N_STATES], from_start = 0.0, from_state = 0.0;
    flight_linearise_at(solver, start);
    invert_small(N_STATES, solver->hessian, inverse);
    for (size_t k = STATE_U; k <= STATE_W; k++) {
        double step = 0.0;
        for (size_t j = 0; j < N_STATES; j++) {
            step += inverse[k * N_STATES + j] * solver->gradient[j];
        }
        const double apart = start[k] + step - state[k];
        from_start += step * step;
        from_state += apart * apart;
    }
    /* g' H^-1 g: the decrease of the cost that the step predicts. */
    const double gained = quadratic(N_STATES, solver->gradient, inverse, solver->gradient);
    const double near = 0.5 * next_to_plane(solver->map);
    return from_state > from_start && from_state > near * near && solver->cost - gained < cost + PREDICTED;
}

/* Whether the state of the problem is one of the solutions, within SAME of a standard deviation squared. */
static int is_among(const FlightSolver *solver, const Solutions *all) {
    int found = 0;
    for (size_t s = 0; s < all->count; s++) {
        double apart[N_STATES];
        for (size_t k = 0; k < N_STATES; k++) {
            apart[k] = all->state[s][k] - solver->state[k];
        }
        found |= quadratic(N_STATES, apart, solver->hessian, apart) < SAME;
    }
    return found;
}

/* Solutions from all starts that lead elsewhere. Where none does, the problem is brought back to what it was: most
   samples end here. */
static int find_solutions(FlightSolver *solver, Solutions *all) {
    double start[MOST_OTHERS][N_STATES];
    const double cost = solver->cost;
    size_t starts = flight_search_minima(solver, all->state[0], start), count = 0;
    starts += mirror_starts(solver, all->state[0], start + starts);
    for (size_t s = 0; s < starts; s++) {
        if (leads_elsewhere(solver, start[s], all->state[0], cost)) {
            memmove(start[count++], start[s], sizeof start[s]);
        }
    }
    if (count == 0) {
        flight_linearise_at(solver, all->state[0]);
        return 0;
    }
    flight_linearise_anew(solver, all->state[0]);
    all->deviance[0] = flight_deviance(solver);
    for (size_t s = 0; s < count; s++) {
        const double deviance = flight_iterate_start(solver, start[s]);
        if (!is_among(solver, all)) {
            memcpy(all->state[all->count], start[s], sizeof start[s]);
            all->deviance[all->count++] = deviance;
        }
    }
    return 1;
}

static void add_difference(size_t order, double part, const double *value, const double *other, double *covariance) {
    for (size_t i = 0; i < order; i++) {
        for (size_t j = 0; j < order; j++) {
            covariance[i * order + j] += part * ((other[i] - value[i]) * (other[j] - value[j]));
        }
    }
}

/* The solution from the best state on, with the differences to the others. Loads and coefficients of each are
   computed at its own state. */
static void conclude(FlightSolver *solver, const Solutions *all, size_t best, const KeptSolution *kept) {
    Solution *solution = &solver->solution;
    double part[MOST_OTHERS], loads[MOST_OTHERS][N_LOADS], coefficients[MOST_OTHERS][N_LOADS];
    size_t other[MOST_OTHERS], n_others = 0;
    for (size_t s = 0; s < all->count; s++) {
        const double weight = flight_weight_of_excess(all->deviance[s] - all->deviance[best]);
        if (s == best || !(weight > 0.0)) {
            continue;
        }
        flight_linearise_anew(solver, all->state[s]);
        flight_weigh_full(solver, N_STATES);
        flight_set_loads(solver);
        memcpy(loads[n_others], solution->loads, sizeof solution->loads);
        memcpy(coefficients[n_others], solution->coefficients, sizeof solution->coefficients);
        part[n_others] = PART * weight;
        other[n_others++] = s;
    }
    if (best == 0) {
        flight_take_again(solver, kept);
    } else {
        flight_solve_again(solver, all->state[best], all->state[best]);
        memcpy(solution->navigation_residual, kept->residual, sizeof kept->residual);
    }
    if (kept->widening[0] != 0.0) {
        flight_widen(solver, kept->widening);
    }
    solution->n_others = n_others;
    for (size_t s = 0; s < n_others; s++) {
        const double *state = all->state[other[s]];
        solution->other_part[s] = part[s];
        memcpy(solution->other_state[s], state, sizeof solution->other_state[s]);
        add_difference(N_STATES, part[s], solution->state, state, solution->widened_covariance);
        add_difference(N_LOADS, part[s], solution->loads, loads[s], solution->load_covariance);
        add_difference(N_LOADS, part[s], solution->coefficients, coefficients[s], solution->coefficient_covariance);
    }
}

void flight_look_for_others(FlightSolver *solver) {
    Solutions all = {.count = 1};
    const KeptSolution kept = flight_keep(solver);
    memcpy(all.state[0], kept.state, sizeof kept.state);
    if (!find_solutions(solver, &all)) {
        return;
    }
    size_t best = 0;
    for (size_t s = 1; s < all.count; s++) {
        best = all.deviance[s] < all.deviance[0] - BETTER && all.deviance[s] < all.deviance[best] ? s : best;
    }
    conclude(solver, &all, best, &kept);
}
