/* Starts of the iterations where no last state is known: the best state of a grid at each of six incidences.

   The grid has SEARCH_STARTS incidences, in the middle of six equal parts of the range of (u, w), times SEARCH_MACHS
   Mach numbers from end to end, times SEARCH_ROLLS roll angles: 288 states. At p_inf = 1 Pa the tables give the
   strain t (n) of each, once, when an instance is made; strain is in proportion to p_inf. With the weights W = S^-1,
   S at one state in the middle of the grid, the cost of a state at pressure p is, less d' W d,

       cost(p) = p^2 size - 2 p dot + sum_m (z_m - h_m)^2 / sigma_m^2,     size = t' W t,   dot = t' W (d - d_fixed).

   Strain alone gives p_s = dot / size, clipped to plausible pressures; near it strain determines ln p with the
   information size p_s^2. Navigation and priors know ln p, ln q = ln(gamma/2) + 2 ln M + ln p, M, and the prior of
   ln p. Joined to first order,

       ln p = (size p_s^2 ln p_s + sum_k target_k precision_k) / (size p_s^2 + sum_k precision_k),

   at which the cost is taken. The state of smallest cost at an incidence is a start. From each start
   start_iterations Gauss-Newton iterations follow (flight_solve.c), and the end of smallest -2 ln likelihood is
   solved further.

   Whitened by S = L L', grid and strain need one product each: L^-1 t stands there for all states. Where a gauge is
   not in use W is diag(1 / S_ii), 0 for that gauge. Without the correlations of S strain by inertia, or by anything
   that acts on all gauges, would choose the starts: on the wrong side of the body, where all of them end.

   So a search costs the same whatever it finds. A step may search at most KEPT_SEARCHES times, with all navigation
   and without what is inconsistent; ends are kept for the step by the precisions that they belong to.

   Where gauges are lost the grid also gives other minima: states over incidence and roll angle, at the best Mach
   number, no neighbour of which costs less (policies/ambiguity.c). docs/explanation/nonlinear_estimator.md,
   "Estimate" and "Lost gauges"; starts, grid and _joined in strainfmu/estimator/reference/nonlinear.py. */

#include "nonlinear.h"

#include <math.h>
#include <string.h>

#include "../../core/elementary.h"

#define SMALLEST_PRESSURE 10.0 /* [Pa] of a start */
#define LARGEST_PRESSURE 5e5
#define NEIGHBOURHOOD 1.5 /* distances of two incidences of the search within which a minimum is another one's */
#define LARGEST_EXCESS 5.0 /* of ln of a start's pressure over the range of the tables */

static const double TWO_PI = 6.2831853071795862;

/* The grid: Mach numbers with both ends of the range, incidences in the middle of their parts, roll angles from 0
   on. */
static void set_states(FlightSolver *solver) {
    const FlightMap *map = solver->map;
    const double low = map->mach_range[0], high = map->mach_range[1];
    for (size_t m = 0; m < SEARCH_MACHS; m++) {
        solver->search_mach[m] = m + 1 < SEARCH_MACHS ? low + (double)m * ((high - low) / (SEARCH_MACHS - 1)) : high;
    }
    for (size_t i = 0; i < SEARCH_STARTS; i++) {
        for (size_t k = 0; k < 2; k++) {
            solver->search_crossflow[i][k] = map->crossflow_half[k] * ((double)i + 0.5) / SEARCH_STARTS;
        }
    }
    for (size_t k = 0; k < SEARCH_ROLLS; k++) {
        sine_cosine(TWO_PI * (double)k / SEARCH_ROLLS, &solver->search_sine[k], &solver->search_cosine[k]);
    }
}

/* M, u and w of a state of the grid, by start (incidence) and its number there. */
static void set_state(const FlightSolver *solver, size_t start, size_t which, double *state) {
    const double *size = solver->search_crossflow[start], *middle = solver->map->crossflow_middle;
    state[STATE_MACH] = solver->search_mach[which / SEARCH_ROLLS];
    state[STATE_U] = middle[0] + size[0] * solver->search_cosine[which % SEARCH_ROLLS];
    state[STATE_W] = middle[1] + size[1] * solver->search_sine[which % SEARCH_ROLLS];
}

/* Slopes of strain by u and w at p_inf = 1 Pa in the middle of the ranges: policies/ambiguity.c takes from
   them how well the gauges in use separate a flow from its mirror image. */
static void set_slopes(FlightSolver *solver) {
    const double *middle = solver->map->crossflow_middle;
    const double state[N_STATES] = {solver->search_mach[SEARCH_MACHS / 2], middle[0], middle[1], 0.0};
    flight_response(&solver->tables, solver->wide, state, &solver->response);
    for (size_t k = 0; k < 2; k++) {
        memcpy(solver->search_slope[k], solver->response.jacobian[STATE_U + k], solver->n_gauges * sizeof(double));
    }
}

/* t of all 288 states, which no sample changes. */
void flight_search_prepare(FlightSolver *solver) {
    const size_t n = solver->n;
    set_states(solver);
    set_slopes(solver);
    double state[N_STATES] = {0.0};
    for (size_t i = 0; i < SEARCH_STARTS; i++) {
        for (size_t k = 0; k < SEARCH_STATES; k++) {
            double *strain = solver->search_strain + (i * SEARCH_STATES + k) * n;
            set_state(solver, i, k, state);
            flight_response(&solver->tables, solver->wide, state, &solver->response);
            for (size_t g = 0; g < solver->n_gauges; g++) {
                strain[g] = solver->response.value[g] - solver->map->tables.fixed_response[g];
            }
        }
    }
    flight_search_weigh(solver);
}

/* 1 / sqrt(S_ii) of each gauge, L, and L^-1 t of all states, by S at the middle of the grid. */
void flight_search_weigh(FlightSolver *solver) {
    const size_t n = solver->n;
    double state[N_STATES] = {0.0}, *factor = solver->search_factor;
    set_state(solver, SEARCH_STARTS / 2, 0, state);
    state[STATE_PRESSURE] = solver->map->middle_log_pressure;
    flight_response(&solver->tables, solver->wide, state, &solver->response);
    flight_strain_covariance(solver);
    memcpy(factor, solver->factor, n * n * sizeof *factor);
    for (size_t g = 0; g < n; g++) {
        if (g < solver->n_gauges) {
            solver->search_weight[g] = 1.0 / sqrt(factor[g * n + g]);
        } else {
            factor[g * n + g] = 1.0;
        }
    }
    cholesky(solver->wide, n, factor);
    memcpy(solver->search_whitened, solver->search_strain, SEARCH_STARTS * SEARCH_STATES * n * sizeof *factor);
    solve_lower(solver->wide, n, factor, SEARCH_STARTS * SEARCH_STATES, solver->search_whitened);
}

/* dot = sum of weighted t, size = sum of square t^2. */
EVERYWHERE void compare(size_t n, const double *restrict weighted, const double *restrict square,
                        const double *restrict strain, double *dot, double *size) {
    double d[LANES] = {0.0}, s[LANES] = {0.0};
    for (size_t g = 0; g < n; g += LANES) {
        for (size_t r = 0; r < LANES; r++) {
            const double unit = strain[g + r];
            d[r] += weighted[g + r] * unit;
            s[r] += square[g + r] * (unit * unit);
        }
    }
    *dot = (d[0] + d[1]) + (d[2] + d[3]);
    *size = (s[0] + s[1]) + (s[2] + s[3]);
}

FOR_AVX2(compare, (size_t n, const double *weighted, const double *square, const double *strain, double *dot,
          double *size),
         (n, weighted, square, strain, dot, size))

/* What is known of ln p_inf at a Mach number without strain: three targets with their precisions, from p_inf, q_inf
   and the prior. */
typedef struct {
    double target[3], precision[3];
    double of_mach; /* what they hold against the Mach number */
} Knowledge;

/* The targets at one Mach number, of which ln q_inf gives ln p_inf; what differs from M itself costs of_mach. */
static Knowledge knowledge_at(const FlightSolver *solver, double mach) {
    const Sample *sample = &solver->sample;
    const double of_mach = sample->value[0] - mach, of_prior = sample->value[N_NAVIGATION + STATE_MACH] - mach;
    const size_t prior = N_NAVIGATION + STATE_PRESSURE;
    return (Knowledge){
        .target = {sample->value[1], sample->value[2] - (solver->map->log_half_gamma + 2.0 * logarithm(mach)),
                   sample->value[prior]},
        .precision = {sample->precision[1], sample->precision[2], sample->precision[prior]},
        .of_mach = sample->precision[0] * (of_mach * of_mach)
                 + sample->precision[N_NAVIGATION + STATE_MACH] * (of_prior * of_prior),
    };
}

/* ln p_inf of strain (its value and information) with the three targets; *cost is what these and M cost there. */
static double joined_pressure(const Knowledge *known, double log_pressure, double information, double *cost) {
    double sum = information * log_pressure, total = information;
    for (int k = 0; k < 3; k++) {
        sum += known->precision[k] * known->target[k];
        total += known->precision[k];
    }
    const double joined = sum / total;
    *cost = known->of_mach;
    for (int k = 0; k < 3; k++) {
        const double off = known->target[k] - joined;
        *cost += known->precision[k] * (off * off);
    }
    return joined;
}

/* (z - h)^2 / sigma^2 of measured angles, which are values of u and w. */
static double against_angles(const FlightSolver *solver, size_t start, size_t which) {
    double state[N_STATES] = {0.0}, cost = 0.0;
    set_state(solver, start, which, state);
    for (size_t k = 0; k < 2; k++) {
        const double off = solver->angles.value[k] - state[STATE_U + k];
        cost += solver->angles.precision[k] * (off * off);
    }
    return cost;
}

/* A comparison of the grid with a sample. */
typedef struct {
    const double *grid; /* L^-1 t, or t where a gauge is not in use */
    double *weighted;   /* L^-1 (d - d_fixed), or W (d - d_fixed), */
    double *square;     /* and 1, or diag(W) */
} Comparison;

/* It stands in solver->turned until the first iteration. */
static Comparison weighed(FlightSolver *solver) {
    const Sample *sample = &solver->sample;
    const size_t n = solver->n;
    Comparison out = {solver->search_whitened, solver->turned, solver->turned + n};
    for (size_t g = 0; g < solver->n_gauges; g++) {
        out.grid = sample->used[g] ? out.grid : solver->search_strain;
    }
    const int whitens = out.grid == solver->search_whitened;
    memset(out.weighted, 0, 2 * n * sizeof *out.weighted);
    for (size_t g = 0; g < solver->n_gauges; g++) {
        const double weight = whitens ? 1.0 : sample->used[g] ? solver->search_weight[g] : 0.0;
        out.square[g] = weight * weight;
        out.weighted[g] = sample->used[g] ? (sample->strain[g] - solver->map->tables.fixed_response[g]) * out.square[g] : 0.0;
    }
    if (whitens) {
        solve_lower(solver->wide, n, solver->search_factor, 1, out.weighted);
    }
    return out;
}

/* Cost and ln p_inf of the SEARCH_STATES states at one incidence. Logarithms and exponentials are taken of all
   together, so that their divisions do not wait for each other. */
static void set_costs(const FlightSolver *solver, const Comparison *with, size_t start, double *cost,
                      double *log_pressure) {
    const size_t n = solver->n;
    double dot[SEARCH_STATES], size[SEARCH_STATES], by_strain[SEARCH_STATES];
    double pressure[SEARCH_STATES], of_navigation[SEARCH_STATES];
    for (size_t k = 0; k < SEARCH_STATES; k++) {
        CHOSEN(solver->wide, compare)(n, with->weighted, with->square, with->grid + (start * SEARCH_STATES + k) * n,
                                      &dot[k], &size[k]);
        by_strain[k] = clipped(dot[k] / (size[k] > 1e-300 ? size[k] : 1e-300), SMALLEST_PRESSURE, LARGEST_PRESSURE);
    }
    memcpy(log_pressure, by_strain, sizeof by_strain);
    logarithms(SEARCH_STATES, log_pressure);
    Knowledge known = {.of_mach = 0.0};
    for (size_t k = 0; k < SEARCH_STATES; k++) {
        if (k % SEARCH_ROLLS == 0) {
            known = knowledge_at(solver, solver->search_mach[k / SEARCH_ROLLS]);
        }
        log_pressure[k] =
            joined_pressure(&known, log_pressure[k], size[k] * (by_strain[k] * by_strain[k]), &of_navigation[k]);
    }
    memcpy(pressure, log_pressure, sizeof pressure);
    exponentials(SEARCH_STATES, pressure);
    for (size_t k = 0; k < SEARCH_STATES; k++) {
        cost[k] = (pressure[k] * pressure[k] * size[k] - 2.0 * pressure[k] * dot[k]) + of_navigation[k];
        if (solver->angles.count > 0) {
            cost[k] += against_angles(solver, start, k);
        }
    }
}

/* A state of the grid with its ln p_inf, kept within a factor e^5 of the range: far beyond it no iteration returns. */
static void set_start_at(const FlightSolver *solver, size_t start, size_t which, double log_pressure, double *state) {
    const double *range = solver->map->log_pressure_range;
    set_state(solver, start, which, state);
    state[STATE_PRESSURE] = clipped(log_pressure, range[0] - LARGEST_EXCESS, range[1] + LARGEST_EXCESS);
}

/* The best state at an incidence, by its index. */
static void set_start(const FlightSolver *solver, const Comparison *with, size_t start, double *state) {
    double cost[SEARCH_STATES], log_pressure[SEARCH_STATES];
    set_costs(solver, with, start, cost, log_pressure);
    size_t best = 0;
    for (size_t k = 1; k < SEARCH_STATES; k++) {
        best = cost[k] < cost[best] ? k : best;
    }
    set_start_at(solver, start, best, log_pressure[best], state);
}

/* A search of the same strain with the same precisions ends where it ended before in this step. */
static KeptEnds *kept_ends(FlightSolver *solver) {
    for (size_t k = 0; k < solver->n_kept; k++) {
        KeptEnds *kept = &solver->kept[k];
        if (memcmp(kept->precision, solver->sample.precision, sizeof kept->precision) == 0) {
            return kept;
        }
    }
    return NULL;
}

int flight_search_kept(FlightSolver *solver) {
    return kept_ends(solver) != NULL;
}

size_t flight_search_ends(FlightSolver *solver) {
    KeptEnds *ends = kept_ends(solver);
    size_t best = 0;
    /* A third search in one step would break the bound on its time: the last ends stay. */
    if (ends == NULL && solver->n_kept < KEPT_SEARCHES) {
        const Comparison with = weighed(solver);
        ends = &solver->kept[solver->n_kept++];
        memcpy(ends->precision, solver->sample.precision, sizeof ends->precision);
        for (size_t start = 0; start < SEARCH_STARTS; start++) {
            set_start(solver, &with, start, ends->end[start]);
        }
        for (size_t start = 0; start < SEARCH_STARTS; start++) {
            ends->deviance[start] = flight_iterate_start(solver, ends->end[start]);
        }
    }
    solver->ends = ends != NULL ? ends : solver->ends;
    for (size_t start = 1; start < SEARCH_STARTS; start++) {
        best = solver->ends->deviance[start] < solver->ends->deviance[best] ? start : best;
    }
    return best;
}

void flight_solve_cold(FlightSolver *solver) {
    const size_t best = flight_search_ends(solver);
    flight_solve_from(solver, solver->ends->end[best]);
}

/* States at an incidence and a roll angle, the best Mach number of each. */
typedef struct {
    double cost[SEARCH_STARTS][SEARCH_ROLLS], log_pressure[SEARCH_STARTS][SEARCH_ROLLS];
    size_t which[SEARCH_STARTS][SEARCH_ROLLS];
} Directions;

static void set_directions(FlightSolver *solver, Directions *all) {
    double cost[SEARCH_STATES], log_pressure[SEARCH_STATES];
    const Comparison with = weighed(solver);
    for (size_t start = 0; start < SEARCH_STARTS; start++) {
        set_costs(solver, &with, start, cost, log_pressure);
        for (size_t roll = 0; roll < SEARCH_ROLLS; roll++) {
            size_t best = roll;
            for (size_t k = roll + SEARCH_ROLLS; k < SEARCH_STATES; k += SEARCH_ROLLS) {
                best = cost[k] < cost[best] ? k : best;
            }
            all->which[start][roll] = best;
            all->cost[start][roll] = cost[best];
            all->log_pressure[start][roll] = log_pressure[best];
        }
    }
}

/* Whether no neighbour costs less: eight around, over the axis at the smallest incidence. */
static int is_minimum(const Directions *all, size_t start, size_t roll) {
    const double cost = all->cost[start][roll];
    int least = 1;
    for (size_t by = SEARCH_ROLLS - 1; by <= SEARCH_ROLLS + 1; by++) {
        const size_t beside = (roll + by) % SEARCH_ROLLS, opposite = (beside + SEARCH_ROLLS / 2) % SEARCH_ROLLS;
        const double inner = start > 0 ? all->cost[start - 1][beside] : all->cost[0][opposite];
        const double outer = start + 1 < SEARCH_STARTS ? all->cost[start + 1][beside] : INFINITY;
        least = least && cost <= all->cost[start][beside] && cost <= inner && cost <= outer;
    }
    return least;
}

/* Whether two states lie within NEIGHBOURHOOD distances of the grid in (u, w): they would end in the same solution. */
static int is_near(const FlightSolver *solver, const double *state, const double *other) {
    double square = 0.0;
    for (size_t k = 0; k < 2; k++) {
        const double apart = (state[STATE_U + k] - other[STATE_U + k]) / solver->map->crossflow_half[k];
        square += apart * apart * (double)(SEARCH_STARTS * SEARCH_STARTS);
    }
    return square < NEIGHBOURHOOD * NEIGHBOURHOOD;
}

size_t flight_search_minima(FlightSolver *solver, const double *state, double minimum[MOST_MINIMA][N_STATES]) {
    Directions all;
    double cost[MOST_MINIMA];
    size_t count = 0;
    set_directions(solver, &all);
    for (size_t start = 0; start < SEARCH_STARTS; start++) {
        for (size_t roll = 0; roll < SEARCH_ROLLS; roll++) {
            double one[N_STATES];
            set_start_at(solver, start, all.which[start][roll], all.log_pressure[start][roll], one);
            if (!is_minimum(&all, start, roll) || is_near(solver, one, state)) {
                continue;
            }
            /* Insert by cost; the worst one falls out where there are MOST_MINIMA already. */
            size_t at = count < MOST_MINIMA ? count++ : MOST_MINIMA;
            for (; at > 0 && all.cost[start][roll] < cost[at - 1]; at--) {
                if (at < MOST_MINIMA) {
                    cost[at] = cost[at - 1];
                    memcpy(minimum[at], minimum[at - 1], sizeof one);
                }
            }
            if (at < MOST_MINIMA) {
                cost[at] = all.cost[start][roll];
                memcpy(minimum[at], one, sizeof one);
            }
        }
    }
    return count;
}
