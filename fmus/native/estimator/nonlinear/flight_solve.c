/* The flight state that fits strain and air data, by Gauss-Newton iterations of a fixed number, and what follows
   from it.

   State x = (M, u, w, ln p_inf), 4. Strain d (n) has the tables y(x) with the Jacobian J (n, 4) and the error
   covariance S(x) = L L' (n, n). Seven measurements z_m with the precision 1 / sigma_m^2, 0 where one is not given,
   are M, ln p_inf and ln q_inf of navigation, then the ranges of the map as a weak prior of the four states,
   measured angles included; they read h_m(x) with rows H_m (4). The iterations minimise

       cost(x) = | L^-1 (d - y(x)) |^2 + sum_m (z_m - h_m(x))^2 / sigma_m^2.

   About x, with rho = L^-1 (d - y), A = L^-1 J (both in `right`), and S not differentiated,

       H = A' A + sum_m H_m' H_m / sigma_m^2        hessian
       g = A' rho + sum_m H_m' (z_m - h_m) / sigma_m^2   gradient, of -cost / 2
       x becomes x + a H^-1 g                       limited by largest_step and the reach of the tables

   a is 1, or shorter where strain curves away: with the last change of the state dx and the decrease of the whole
   step v, a = dx' H v / v' H v between SMALLEST_PART and 1 (Barzilai and Borwein, IMA J. Numer. Anal. 8, 1988, the
   shorter of their steps in the metric of H). S is renewed every second iteration of a cold solution, half-way in a
   start of the search, and once at the last state of a warm one: a decomposition of S costs as much as an iteration.

   Covariances and alarms follow from the full model, with the considered errors: S_full, H_full, g_full in `full`.

       shift      = H_full^-1 g_full                its estimate of the state, less x
       chi-square = cost_full - g_full' H_full^-1 g_full
       P          = S_full^-1 - S_full^-1 J H_full^-1 J' S_full^-1
       z_i        = (S_full^-1 (d - y - J shift))_i / sqrt(P_ii)                     gauges
       z_m        = (z_m - h_m - H_m shift) / sqrt(sigma_m^2 - H_m H_full^-1 H_m')   navigation
       shape^2    = r' P B (B' P B)^-1 B' P r       B (n, n_shapes) the discrepancy modes

   docs/explanation/nonlinear_estimator.md, "Roles of the errors", "Estimate" and "What comes out";
   strainfmu/estimator/reference/nonlinear.py iterates until it converges. */

#include "nonlinear.h"

#include <math.h>

#include "../../core/elementary.h"

#define MIN_MACH 0.1       /* below which ln M goes on as a constant */
#define SMALLEST_PART 0.25 /* of a step that is taken */
#define AT_ONCE 6          /* ratios of standard deviations up to 1e51 have a product */
#define LEAST_SEEN 1e-9    /* of the variance of a shape; what others leave below it is lost in rounding */

/* L of a covariance. A gauge that is not in use gets row and column of the unit matrix: with a residual of 0 it has
   no effect, and the order n stays. */
static void decompose(const FlightSolver *solver, double *factor) {
    const size_t n = solver->n;
    for (size_t g = 0; g < n; g++) {
        if (g < solver->n_gauges && solver->sample.used[g]) {
            continue;
        }
        for (size_t i = 0; i < n; i++) {
            factor[g * n + i] = factor[i * n + g] = 0.0;
        }
        factor[g * n + g] = 1.0;
    }
    cholesky(solver->wide, n, factor);
}

/* L of S at the state of solver->response; factor_state notes where, so that the same solution can be made again. */
static void set_factor(FlightSolver *solver) {
    solver->factor_pressure = solver->response.pressure;
    memcpy(solver->factor_state, solver->state, sizeof solver->factor_state);
    flight_strain_covariance(solver);
    decompose(solver, solver->factor);
}

static void evaluate(FlightSolver *solver, const double *state) {
    memmove(solver->state, state, sizeof solver->state);
    flight_response(&solver->tables, solver->wide, solver->state, &solver->response);
}

static double larger_mach(double mach) {
    return mach > MIN_MACH ? mach : MIN_MACH;
}

/* z_m - h_m(x). Below MIN_MACH ln M goes on as a constant, so that no iteration meets the logarithm of a negative
   number. */
static void set_innovation(FlightSolver *solver) {
    const double *state = solver->state, *value = solver->sample.value;
    const double mach = larger_mach(state[STATE_MACH]);
    double *innovation = solver->innovation;
    innovation[0] = value[0] - state[STATE_MACH];
    innovation[1] = value[1] - state[STATE_PRESSURE];
    innovation[2] = value[2] - (solver->map->log_half_gamma + 2.0 * logarithm(mach) + state[STATE_PRESSURE]);
    for (size_t k = 0; k < N_STATES; k++) {
        innovation[N_NAVIGATION + k] = value[N_NAVIGATION + k] - state[k];
    }
    solver->log_mach_slope = 2.0 / larger_mach(state[STATE_MACH]);
}

void flight_measurement_row(double log_mach_slope, size_t which, double *row) {
    memset(row, 0, N_STATES * sizeof *row);
    if (which >= N_NAVIGATION) {
        row[which - N_NAVIGATION] = 1.0;
    } else if (which == 0) {
        row[STATE_MACH] = 1.0;
    } else {
        row[STATE_PRESSURE] = 1.0;
        row[STATE_MACH] = which == 2 ? log_mach_slope : 0.0;
    }
}

/* L^-1 of residual and Jacobian in `right`, then H, g and cost of strain by one product of all pairs of these five
   vectors, and the terms of the measurements. */
static void weigh(const FlightSolver *solver, const double *factor, double *right, double *hessian, double *gradient,
                  double *cost) {
    const size_t n = solver->n;
    memset(right, 0, N_RIGHT * n * sizeof *right);
    for (size_t g = 0; g < solver->n_gauges; g++) {
        if (solver->sample.used[g]) {
            right[g] = solver->sample.strain[g] - solver->response.value[g];
            for (size_t k = 0; k < N_STATES; k++) {
                right[(1 + k) * n + g] = solver->response.jacobian[k][g];
            }
        }
    }
    solve_lower(solver->wide, n, factor, N_RIGHT, right);
    double products[N_RIGHT][N_RIGHT];
    lane_products(solver->wide, n, right, products);
    for (size_t i = 0; i < N_STATES; i++) {
        for (size_t j = 0; j < N_STATES; j++) {
            hessian[i * N_STATES + j] = products[1 + i][1 + j];
        }
        gradient[i] = products[1 + i][0];
    }
    *cost = products[0][0];
    for (size_t m = 0; m < N_MEASURED; m++) {
        const double precision = solver->sample.precision[m], innovation = solver->innovation[m];
        double row[N_STATES];
        flight_measurement_row(solver->log_mach_slope, m, row);
        for (size_t i = 0; i < N_STATES; i++) {
            const double weighted = precision * row[i];
            for (size_t j = 0; j < N_STATES; j++) {
                hessian[i * N_STATES + j] += weighted * row[j];
            }
            gradient[i] += weighted * innovation;
        }
        *cost += precision * (innovation * innovation);
    }
}

/* The problem about the state of solver->response, weighted by the last S. */
static void linearise(FlightSolver *solver) {
    set_innovation(solver);
    weigh(solver, solver->factor, solver->right, solver->hessian, solver->gradient, &solver->cost);
}

/* The full model about the same state. With n_free below 4 the last states are held fixed: policies/ambiguity.c
   moves ln p_inf to a value and asks for the rest. Their rows of the covariance are 0 then. */
void flight_weigh_full(FlightSolver *solver, size_t n_free) {
    FullModel *full = &solver->full;
    double inner[N_STATES * N_STATES], inverse[N_STATES * N_STATES];
    /* One considered error may have tables of its own, by the same state. */
    if (solver->map->considered.n_rows > 0) {
        flight_response(&full->tables, solver->wide, solver->state, &full->response);
    }
    flight_full_covariance(solver);
    decompose(solver, full->factor);
    weigh(solver, full->factor, full->right, full->hessian, full->gradient, &full->cost);
    for (size_t i = 0; i < n_free; i++) {
        memcpy(inner + i * n_free, full->hessian + i * N_STATES, n_free * sizeof *inner);
    }
    invert_small(n_free, inner, inverse);
    memset(full->state_covariance, 0, sizeof full->state_covariance);
    for (size_t i = 0; i < n_free; i++) {
        memcpy(full->state_covariance + i * N_STATES, inverse + i * n_free, n_free * sizeof *inverse);
    }
    small_times(N_STATES, full->state_covariance, full->gradient, full->shift);
}

/* x + step, shortened as a whole so that no state moves by more than its largest step, then brought back to where
   the tangents of the tables hold: 30 % beyond the Mach numbers, 1.5 times the incidence, a factor e of pressure. */
void flight_limited(const FlightMap *map, const double *from, const double *step, double *state) {
    double size = 1.0;
    for (size_t i = 0; i < N_STATES; i++) {
        const double relative = fabs(step[i]) / map->largest_step[i];
        size = relative > size ? relative : size;
    }
    for (size_t i = 0; i < N_STATES; i++) {
        state[i] = from[i] + step[i] / size;
    }
    state[STATE_MACH] = clipped(state[STATE_MACH], 0.7 * map->mach_range[0], 1.3 * map->mach_range[1]);
    const double angle = sqrt(state[STATE_U] * state[STATE_U] + state[STATE_W] * state[STATE_W]);
    const double limit = 1.5 * map->incidence_limit;
    const double part = limit / (angle > 1e-12 ? angle : 1e-12);
    if (part < 1.0) {
        state[STATE_U] *= part;
        state[STATE_W] *= part;
    }
    state[STATE_PRESSURE] =
        clipped(state[STATE_PRESSURE], map->log_pressure_range[0] - 1.0, map->log_pressure_range[1] + 1.0);
}

/* a of the step at hand: 1 in the first iteration, and where curvature along the last change says nothing. */
static double part_of_step(const FlightSolver *solver, const double *step) {
    double change[N_STATES], shrunk[N_STATES];
    if (!solver->has_before) {
        return 1.0;
    }
    for (size_t i = 0; i < N_STATES; i++) {
        change[i] = solver->state[i] - solver->before[i];
        shrunk[i] = solver->whole_step[i] - step[i];
    }
    const double along = quadratic(N_STATES, change, solver->hessian, shrunk);
    const double size = quadratic(N_STATES, shrunk, solver->hessian, shrunk);
    if (!(along > 0.0 && along < size)) {
        return 1.0;
    }
    return along / size > SMALLEST_PART ? along / size : SMALLEST_PART;
}

/* x + a H^-1 g; state and whole step are noted for the next a. */
static void next_state(FlightSolver *solver, double *state) {
    double inverse[N_STATES * N_STATES], step[N_STATES];
    invert_small(N_STATES, solver->hessian, inverse);
    small_times(N_STATES, inverse, solver->gradient, step);
    const double part = part_of_step(solver, step);
    memcpy(solver->before, solver->state, sizeof solver->before);
    memcpy(solver->whole_step, step, sizeof step);
    solver->has_before = 1;
    for (size_t i = 0; i < N_STATES; i++) {
        step[i] *= part;
    }
    flight_limited(solver->map, solver->state, step, state);
}

/* z_i of all gauges, which need the diagonal of P and so the whole L^-1: once in a step, after the solution is
   chosen. back[0] = S_full^-1 (d - y), back[1 + k] = S_full^-1 J_k. */
void flight_set_gauge_residuals(FlightSolver *solver) {
    const size_t n = solver->n;
    const FullModel *full = &solver->full;
    double *back = solver->turned;
    invert_lower(solver->wide, n, full->factor, back, solver->inverse);
    turn_back(solver->wide, n, solver->inverse, full->right, back, solver->squares);
    for (size_t g = 0; g < solver->n_gauges; g++) {
        double row[N_STATES], residual = back[g];
        for (size_t k = 0; k < N_STATES; k++) {
            row[k] = back[(1 + k) * n + g];
            residual -= row[k] * full->shift[k];
        }
        const double diagonal = solver->squares[g] - quadratic(N_STATES, row, full->state_covariance, row);
        solver->solution.standardised_residual[g] =
            solver->sample.used[g] && diagonal > 0.0 ? residual / sqrt(diagonal) : 0.0;
    }
}

/* L_full^-1 B, with zeros for gauges that are not in use. */
static void whiten_shapes(FlightSolver *solver) {
    const size_t n = solver->n, count = solver->map->n_shapes;
    double *shapes = solver->shapes;
    memset(shapes, 0, count * n * sizeof *shapes);
    for (size_t s = 0; s < count; s++) {
        for (size_t g = 0; g < solver->n_gauges; g++) {
            shapes[s * n + g] = solver->sample.used[g] ? solver->map->shapes[s * solver->n_gauges + g] : 0.0;
        }
    }
    solve_lower(solver->wide, n, solver->full.factor, count, shapes);
}

/* shape^2 by the Cholesky factor T of B' P B, a row at a time: T T' = B' P B, size = T^-1 B' P r, shape^2 =
   |size|^2. A shape counts for nothing where the shapes before it leave a rounding error of its variance. */
static void set_shape_square(FlightSolver *solver) {
    const size_t n = solver->n, count = solver->map->n_shapes;
    const FullModel *full = &solver->full;
    Solution *solution = &solver->solution;
    double by_state[MAX_SHAPES][N_STATES], factor[MAX_SHAPES][MAX_SHAPES], size[MAX_SHAPES];
    solution->shape_square = 0.0;
    whiten_shapes(solver);
    for (size_t s = 0; s < count; s++) {
        const double *shape = solver->shapes + s * n;
        const double alone = dot(n, shape, shape);
        double rest = dot(n, shape, full->right);
        for (size_t k = 0; k < N_STATES; k++) {
            by_state[s][k] = dot(n, shape, full->right + (1 + k) * n);
            rest -= by_state[s][k] * full->shift[k];
        }
        /* Diagonal of B' P B, from which the rows above take their squares. */
        double left = alone - quadratic(N_STATES, by_state[s], full->state_covariance, by_state[s]);
        for (size_t t = 0; t < s; t++) {
            double common = dot(n, shape, solver->shapes + t * n)
                          - quadratic(N_STATES, by_state[s], full->state_covariance, by_state[t]);
            for (size_t k = 0; k < t; k++) {
                common -= factor[s][k] * factor[t][k];
            }
            factor[s][t] = factor[t][t] > 0.0 ? common / factor[t][t] : 0.0;
            left -= factor[s][t] * factor[s][t];
            rest -= factor[s][t] * size[t];
        }
        const int seen = left > LEAST_SEEN * alone;
        factor[s][s] = seen ? sqrt(left) : 0.0;
        size[s] = seen ? rest / factor[s][s] : 0.0;
        solution->shape_square += size[s] * size[s];
    }
}

/* z_m of navigation at the minimum of the linearised problem. */
static void set_navigation_residuals(FlightSolver *solver) {
    const FullModel *full = &solver->full;
    Solution *solution = &solver->solution;
    for (size_t m = 0; m < N_NAVIGATION; m++) {
        const double precision = solver->sample.precision[m];
        double row[N_STATES];
        flight_measurement_row(solver->log_mach_slope, m, row);
        const double reached = quadratic(N_STATES, row, full->state_covariance, row);
        const double variance = precision > 0.0 ? 1.0 / precision - reached : 0.0;
        const double remaining = solver->innovation[m] - along_state(row, full->shift);
        solution->navigation_residual[m] = variance > 0.0 ? remaining / sqrt(variance) : 0.0;
    }
}

/* What u and w of priors and measured angles cost more than u and w of the priors alone: angles have a test of their
   own (angles_contradict), and must not count in chi-square. */
static double cost_of_angles(const FlightSolver *solver) {
    double cost = 0.0;
    for (size_t k = STATE_U; k <= STATE_W && solver->angles.count > 0; k++) {
        const double shift = solver->full.shift[k], joined = solver->innovation[N_NAVIGATION + k] - shift;
        const double prior = solver->map->prior_mean[k] - solver->state[k] - shift;
        cost += solver->sample.precision[N_NAVIGATION + k] * (joined * joined)
              - solver->map->prior_precision[k] * (prior * prior);
    }
    return cost;
}

/* Conclude at the state of the problem: covariance H^-1 of the model that the gain follows, the square of the next
   step in its standard deviations (rest_square), then all that follows from the full model. */
static void flight_settle(FlightSolver *solver) {
    const FullModel *full = &solver->full;
    Solution *solution = &solver->solution;
    memcpy(solution->state, solver->state, sizeof solution->state);
    invert_small(N_STATES, solver->hessian, solution->state_covariance);
    memset(solution->widening, 0, sizeof solution->widening);
    solution->n_others = 0;
    solution->rest_square = quadratic(N_STATES, solver->gradient, solution->state_covariance, solver->gradient);
    flight_weigh_full(solver, N_STATES);
    flight_set_loads(solver);
    solution->chi_square = full->cost - along_state(full->gradient, full->shift) - cost_of_angles(solver);
    set_navigation_residuals(solver);
    set_shape_square(solver);
}

/* S at the last state serves all iterations of the step: the state moves little from sample to sample. */
void flight_solve_warm(FlightSolver *solver, const double *state) {
    double next[N_STATES];
    solver->has_before = 0;
    evaluate(solver, state);
    set_factor(solver);
    for (size_t k = 0; k < (size_t)solver->map->warm_iterations; k++) {
        solver->iterations++;
        linearise(solver);
        next_state(solver, next);
        evaluate(solver, next);
    }
    linearise(solver);
    flight_settle(solver);
}

/* The same evaluations in the same order as of the solution that was left, so that its bits come back. */
void flight_solve_again(FlightSolver *solver, const double *weighted_at, const double *state) {
    evaluate(solver, weighted_at);
    set_factor(solver);
    evaluate(solver, state);
    linearise(solver);
    flight_settle(solver);
}

KeptSolution flight_keep(const FlightSolver *solver) {
    KeptSolution kept;
    memcpy(kept.state, solver->solution.state, sizeof kept.state);
    memcpy(kept.weighted_at, solver->factor_state, sizeof kept.weighted_at);
    memcpy(kept.precision, solver->sample.precision, sizeof kept.precision);
    memcpy(kept.residual, solver->solution.navigation_residual, sizeof kept.residual);
    memcpy(kept.widening, solver->solution.widening, sizeof kept.widening);
    return kept;
}

void flight_take_again(FlightSolver *solver, const KeptSolution *kept) {
    memcpy(solver->sample.precision, kept->precision, sizeof kept->precision);
    flight_solve_again(solver, kept->weighted_at, kept->state);
    memcpy(solver->solution.navigation_residual, kept->residual, sizeof kept->residual);
}

void flight_linearise_at(FlightSolver *solver, const double *state) {
    evaluate(solver, state);
    linearise(solver);
}

void flight_linearise_anew(FlightSolver *solver, const double *state) {
    evaluate(solver, state);
    set_factor(solver);
    linearise(solver);
}

/* -2 ln likelihood less a constant: cost + ln det S, ln det S = 2 sum of ln L_ii. One logarithm serves AT_ONCE
   gauges: of the product of their L_ii over the first one's. */
double flight_deviance(const FlightSolver *solver) {
    const size_t n = solver->n, n_gauges = solver->n_gauges;
    const double first = solver->factor[0];
    double sum = (double)n_gauges * logarithm(first);
    for (size_t g = 0; g < n_gauges; g += AT_ONCE) {
        const size_t end = g + AT_ONCE < n_gauges ? g + AT_ONCE : n_gauges;
        double product = 1.0;
        for (size_t k = g; k < end; k++) {
            product *= solver->factor[k * n + k] / first;
        }
        sum += logarithm(product);
    }
    return solver->cost + 2.0 * sum;
}

/* A start of the search: S at the start and half-way. Its deviance by that S compares the ends. */
double flight_iterate_start(FlightSolver *solver, double *state) {
    const size_t iterations = (size_t)solver->map->start_iterations;
    solver->has_before = 0;
    for (size_t k = 0; k < iterations; k++) {
        solver->iterations++;
        evaluate(solver, state);
        if (k % (iterations / 2) == 0) {
            set_factor(solver);
        }
        linearise(solver);
        next_state(solver, state);
    }
    evaluate(solver, state);
    linearise(solver);
    return flight_deviance(solver);
}

/* A cold solution: S follows the state in every second iteration, and in the last one. */
void flight_solve_from(FlightSolver *solver, const double *state) {
    const size_t iterations = (size_t)solver->map->cold_iterations;
    double next[N_STATES];
    solver->has_before = 0;
    flight_linearise_anew(solver, state);
    for (size_t left = iterations; left-- > 0;) {
        solver->iterations++;
        next_state(solver, next);
        evaluate(solver, next);
        if (left % 2 == 0) {
            set_factor(solver);
        }
        linearise(solver);
    }
    flight_settle(solver);
}
