#include "flight_search.h"

#include <math.h>
#include <string.h>

#include "../../core/elementary.h"
#include "../numerics/cholesky.h"
#include "../numerics/wide.h"
#include "flight_solve.h"
#include "strain_covariance.h"

#define SMALLEST_PRESSURE 10.0 /* [Pa] of a start */
#define LARGEST_PRESSURE 5e5
#define NEIGHBOURHOOD 1.5 /* distances of two incidences of the search within which a minimum is another one's */
#define LARGEST_EXCESS 5.0 /* of ln of a start's pressure over the range of the tables: solve.py */

static const double TWO_PI = 6.2831853071795862;

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

/* Mach number, u and w of a state of the search. */
static void set_state(const FlightSolver *solver, size_t start, size_t which, double *state) {
    const double *size = solver->search_crossflow[start], *middle = solver->map->crossflow_middle;
    state[STATE_MACH] = solver->search_mach[which / SEARCH_ROLLS];
    state[STATE_U] = middle[0] + size[0] * solver->search_cosine[which % SEARCH_ROLLS];
    state[STATE_W] = middle[1] + size[1] * solver->search_sine[which % SEARCH_ROLLS];
}

/* Slopes at p_inf = 1 Pa in the middle of the ranges. */
static void set_slopes(FlightSolver *solver) {
    const double *middle = solver->map->crossflow_middle;
    const double state[N_STATES] = {solver->search_mach[SEARCH_MACHS / 2], middle[0], middle[1], 0.0};
    flight_response(&solver->tables, solver->wide, state, &solver->response);
    for (size_t k = 0; k < 2; k++) {
        memcpy(solver->search_slope[k], solver->response.jacobian[STATE_U + k], solver->n_gauges * sizeof(double));
    }
}

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
                strain[g] = solver->response.value[g] - solver->map->tables.fixed[g];
            }
        }
    }
    flight_search_weigh(solver);
}

void flight_search_weigh(FlightSolver *solver) {
    const size_t n = solver->n;
    double state[N_STATES] = {0.0};
    set_state(solver, SEARCH_STARTS / 2, 0, state);
    state[STATE_PRESSURE] = solver->map->middle_log_pressure;
    flight_response(&solver->tables, solver->wide, state, &solver->response);
    flight_strain_covariance(solver);
    for (size_t g = 0; g < solver->n_gauges; g++) {
        solver->search_weight[g] = 1.0 / sqrt(solver->factor[g * n + g]);
    }
}

/* Sums over the gauges of weighted strain times the strain of a state, and of the square of the latter. */
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

#if HAS_AVX2
AVX2 static void compare_avx2(size_t n, const double *weighted, const double *square, const double *strain,
                              double *dot, double *size) {
    compare(n, weighted, square, strain, dot, size);
}
#endif

/* What navigation and priors say of ln p_inf at a Mach number: three values with their precisions. */
typedef struct {
    double target[3], precision[3];
    double of_mach; /* what they hold against the Mach number */
} Knowledge;

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

/* ln p_inf that joins strain, of an information, with what is known; *cost is the latter's. */
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

/* What the angles hold against a state. */
static double against_angles(const FlightSolver *solver, size_t start, size_t which) {
    double state[N_STATES] = {0.0}, cost = 0.0;
    set_state(solver, start, which, state);
    for (size_t k = 0; k < 2; k++) {
        const double off = solver->angles.value[k] - state[STATE_U + k];
        cost += solver->angles.precision[k] * (off * off);
    }
    return cost;
}

/* Strain of the sample in the search, in sigmas times these, and squares of the latter; 0 of gauges not in use. */
static void weigh_strain(const FlightSolver *solver, double *weighted, double *square) {
    const Sample *sample = &solver->sample;
    memset(weighted, 0, solver->n * sizeof *weighted);
    memset(square, 0, solver->n * sizeof *square);
    for (size_t g = 0; g < solver->n_gauges; g++) {
        const double weight = sample->used[g] ? solver->search_weight[g] : 0.0;
        square[g] = weight * weight;
        weighted[g] = sample->used[g] ? (sample->strain[g] - solver->map->tables.fixed[g]) * square[g] : 0.0;
    }
}

/* What the states at an incidence, by its index, cost, and ln p_inf there; less a constant. */
static void set_costs(FlightSolver *solver, size_t start, double *cost, double *log_pressure) {
    const size_t n = solver->n;
    double *weighted = solver->turned, *square = solver->turned + n;
    weigh_strain(solver, weighted, square);
    double dot[SEARCH_STATES], size[SEARCH_STATES], by_strain[SEARCH_STATES];
    double pressure[SEARCH_STATES], of_navigation[SEARCH_STATES];
    for (size_t k = 0; k < SEARCH_STATES; k++) {
        CHOSEN(solver->wide, compare)(n, weighted, square, solver->search_strain + (start * SEARCH_STATES + k) * n,
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

/* A state of the search with its ln p_inf. */
static void set_start_at(const FlightSolver *solver, size_t start, size_t which, double log_pressure, double *state) {
    const double *range = solver->map->log_pressure_range;
    set_state(solver, start, which, state);
    state[STATE_PRESSURE] = clipped(log_pressure, range[0] - LARGEST_EXCESS, range[1] + LARGEST_EXCESS);
}

/* The best state at an incidence, by its index. */
static void set_start(FlightSolver *solver, size_t start, double *state) {
    double cost[SEARCH_STATES], log_pressure[SEARCH_STATES];
    set_costs(solver, start, cost, log_pressure);
    size_t best = 0;
    for (size_t k = 1; k < SEARCH_STATES; k++) {
        best = cost[k] < cost[best] ? k : best;
    }
    set_start_at(solver, start, best, log_pressure[best], state);
}

/* The search of this step that was of the same navigation: it is as it was, and so is where it ends. */
static const KeptEnds *kept_ends(const FlightSolver *solver) {
    for (size_t k = 0; k < solver->n_kept; k++) {
        const KeptEnds *kept = &solver->kept[k];
        if (memcmp(kept->precision, solver->sample.precision, sizeof kept->precision) == 0) {
            return kept;
        }
    }
    return NULL;
}

int flight_search_kept(const FlightSolver *solver) {
    return kept_ends(solver) != NULL;
}

static void keep(FlightSolver *solver) {
    KeptEnds *kept = &solver->kept[solver->n_kept++];
    memcpy(kept->precision, solver->sample.precision, sizeof kept->precision);
    memcpy(kept->end, solver->end, sizeof kept->end);
    memcpy(kept->deviance, solver->end_deviance, sizeof kept->deviance);
}

size_t flight_search_ends(FlightSolver *solver) {
    const KeptEnds *kept = kept_ends(solver);
    size_t best = 0;
    if (kept != NULL) {
        memcpy(solver->end, kept->end, sizeof solver->end);
        memcpy(solver->end_deviance, kept->deviance, sizeof solver->end_deviance);
    } else if (solver->n_kept < KEPT_SEARCHES) {
        for (size_t start = 0; start < SEARCH_STARTS; start++) {
            set_start(solver, start, solver->end[start]);
            solver->end_deviance[start] = flight_iterate_start(solver, solver->end[start]);
        }
        keep(solver);
    }
    for (size_t start = 1; start < SEARCH_STARTS; start++) {
        best = solver->end_deviance[start] < solver->end_deviance[best] ? start : best;
    }
    return best;
}

void flight_solve_cold(FlightSolver *solver) {
    flight_solve_from(solver, solver->end[flight_search_ends(solver)]);
}

/* States at an incidence and a roll angle, the best Mach number of each. */
typedef struct {
    double cost[SEARCH_STARTS][SEARCH_ROLLS], log_pressure[SEARCH_STARTS][SEARCH_ROLLS];
    size_t which[SEARCH_STARTS][SEARCH_ROLLS];
} Directions;

static void set_directions(FlightSolver *solver, Directions *all) {
    double cost[SEARCH_STATES], log_pressure[SEARCH_STATES];
    for (size_t start = 0; start < SEARCH_STARTS; start++) {
        set_costs(solver, start, cost, log_pressure);
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

/* Whether no neighbour costs less: those around, and of the smallest incidence those on the other side. */
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

/* Whether a state is in the neighbourhood of another one, by the distance of the incidences. */
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
