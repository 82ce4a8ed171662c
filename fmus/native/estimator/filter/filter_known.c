#include "filter_known.h"

#include <math.h>
#include <string.h>

#include "../numerics/arrays.h"
#include "../numerics/cholesky.h"
#include "../numerics/products.h"

/* A state c_k is the amplitude of the strain of the errors along direction k. What is known changes the covariance
   D = L L' of the amplitudes, not the directions: with the covariance B of amplitudes with strain, states of unit variance
   have the strain X = L^-1 B, and what that does not hold is not estimated. All follows from the products of
   nonlinear/flight_known.h. */

#define FAINT 1e-12 /* variance of an amplitude, over that without what is known, below which it is known */

size_t filter_known_doubles(const Filter *filter) {
    const size_t n = filter->gauges, r = filter->map.n_seen, m = filter->map.n_other, loads = N_LOADS;
    const size_t errors = r * (n + loads + m) + filter->rows * filter->rows + loads * (n + loads) + m * (n + 1);
    return filter->laws.n_parameters == 0 ? 0 : errors + m * r + 2 * r * n + r * r;
}

/* Amplitudes per strain: S' W over S' W S, of the strain S of the map and W, 1 over the variances of what else a gauge has.
   S' W S is diagonal. */
static void set_along(Filter *filter) {
    const FilterMap *map = &filter->map;
    const size_t n = filter->solver->n_gauges;
    for (size_t k = 0; k < map->n_seen; k++) {
        const double *strain = map->seen_strain + k * n;
        double *along = filter->along + k * filter->gauges, square = 0.0;
        for (size_t g = 0; g < n; g++) {
            const double own = map->n_own > 0 ? map->own[g] : 0.0;
            along[g] = strain[g] / (map->noise[g * n + g] + own * own);
            square += along[g] * strain[g];
        }
        const double scale = square > 0.0 ? 1.0 / square : 0.0;
        for (size_t g = 0; g < n; g++) {
            along[g] *= scale;
        }
    }
}

void filter_known_arrays(Filter *filter, double **doubles) {
    const size_t n = filter->gauges, r = filter->map.n_seen, m = filter->map.n_other, loads = N_LOADS;
    const FilterMap *map = &filter->map;
    filter->of_map = (SeenErrors){map->seen_strain,  map->seen_load,     filter->rest,         map->rest_load,
                                  map->rest_cross,   map->other_load,  map->other_cross,   map->other_variance};
    filter->errors = filter->of_map;
    if (filter->laws.n_parameters == 0) {
        return;
    }
    filter->left.strain = taken(doubles, r * n);
    filter->left.load = taken(doubles, r * loads);
    filter->left.rest = taken(doubles, filter->rows * filter->rows);
    filter->left.rest_load = taken(doubles, loads * loads);
    filter->left.rest_cross = taken(doubles, loads * n);
    filter->left.other_load = taken(doubles, m * r);
    filter->left.other_cross = taken(doubles, m * n);
    filter->left.other_variance = taken(doubles, m);
    filter->other_by_seen = taken(doubles, m * r);
    filter->along = taken(doubles, r * n);
    filter->amplitude = taken(doubles, r * n);
    filter->amplitude_root = taken(doubles, r * r);
    set_along(filter);
}

/* L of the amplitudes' covariance, whose rows are those of the products' B; what is known is no state: its row is 0. */
static void set_root(Filter *filter) {
    const size_t r = filter->map.n_seen, n = filter->gauges;
    double *root = filter->amplitude_root;
    for (size_t i = 0; i < r; i++) {
        for (size_t j = 0; j <= i; j++) {
            double rest = lane_dot(n, filter->amplitude + i * n, filter->along + j * n);
            for (size_t k = 0; k < j; k++) {
                rest -= root[i * r + k] * root[j * r + k];
            }
            const double own = root[j * r + j];
            root[i * r + j] = i == j ? (rest > FAINT ? sqrt(rest) : 0.0) : own > 0.0 ? rest / own : 0.0;
        }
    }
}

/* x = L^-1 x, n_seen rows of `count` elements; 0 of what is no state. */
static void solve_root(const Filter *filter, size_t count, double *rows) {
    const size_t r = filter->map.n_seen;
    for (size_t i = 0; i < r; i++) {
        const double *root = filter->amplitude_root + i * r;
        double *restrict row = rows + i * count;
        for (size_t j = 0; j < i; j++) {
            const double *restrict above = rows + j * count;
            const double factor = root[j];
            for (size_t k = 0; k < count; k++) {
                row[k] -= factor * above[k];
            }
        }
        const double scale = root[i] > 0.0 ? 1.0 / root[i] : 0.0;
        for (size_t k = 0; k < count; k++) {
            row[k] *= scale;
        }
    }
}

/* Loads of the states (n_seen, count), and what these leave of the loads' covariance with strain (count, n_gauges). */
static void set_loads(const Filter *filter, size_t count, const double *with_strain, double *load, double *rest_cross) {
    const size_t n = filter->solver->n_gauges, r = filter->map.n_seen;
    memset(load, 0, r * count * sizeof *load);
    for (size_t k = 0; k < r; k++) {
        for (size_t i = 0; i < count; i++) {
            for (size_t g = 0; g < n; g++) {
                load[k * count + i] += filter->along[k * filter->gauges + g] * with_strain[i * n + g];
            }
        }
    }
    solve_root(filter, count, load);
    for (size_t i = 0; i < count; i++) {
        double *restrict rest = rest_cross + i * n;
        memcpy(rest, with_strain + i * n, n * sizeof *rest);
        for (size_t k = 0; k < r; k++) {
            const double *restrict strain = filter->left.strain + k * n;
            const double factor = load[k * count + i];
            for (size_t g = 0; g < n; g++) {
                rest[g] -= factor * strain[g];
            }
        }
    }
}

static void set_left(Filter *filter, const Errors *errors) {
    const size_t n = filter->solver->n_gauges, gauges = filter->gauges, rows = filter->rows, m = filter->map.n_other;
    const size_t r = filter->map.n_seen;
    const int wide = filter->solver->wide;
    LeftErrors *left = &filter->left;
    double *amplitude = filter->amplitude;
    multiply(wide, FULL, r, gauges, gauges, by_rows(filter->along, gauges), errors->scaled_covariance, gauges, amplitude,
             gauges);
    set_root(filter);
    solve_root(filter, gauges, amplitude);
    for (size_t i = 0; i < n; i++) {
        memcpy(left->rest + i * rows, errors->scaled_covariance + i * gauges, n * sizeof *amplitude);
    }
    subtract_product(wide, n, r, gauges, (Strided){amplitude, 1, gauges}, amplitude, gauges, left->rest, rows);
    for (size_t k = 0; k < r; k++) {
        memcpy(left->strain + k * n, amplitude + k * gauges, n * sizeof *amplitude);
    }
    set_loads(filter, N_LOADS, errors->load_strain_covariance, left->load, left->rest_cross);
    for (size_t i = 0; i < N_LOADS * N_LOADS; i++) {
        left->rest_load[i] = errors->load_covariance[i];
        for (size_t k = 0; k < r; k++) {
            left->rest_load[i] -= left->load[k * N_LOADS + i / N_LOADS] * left->load[k * N_LOADS + i % N_LOADS];
        }
    }
    set_loads(filter, m, errors->other_strain_covariance, filter->other_by_seen, left->other_cross);
    for (size_t j = 0; j < m; j++) {
        left->other_variance[j] = errors->other_variance[j];
        for (size_t k = 0; k < r; k++) {
            const double load = filter->other_by_seen[k * m + j];
            left->other_load[j * r + k] = load;
            left->other_variance[j] -= load * load;
        }
    }
}

void filter_follow_known(Filter *filter, const Known *known) {
    if (filter->laws.n_parameters == 0) {
        return;
    }
    const double round = known->tables.parts.round;
    if (known->in_use && filter->round != round) {
        set_left(filter, &known->own);
        filter->round = round;
    }
    const LeftErrors *left = &filter->left;
    filter->errors = filter->of_map;
    if (known->in_use) {
        filter->errors = (SeenErrors){left->strain,     left->load,         left->rest,          left->rest_load,
                                      left->rest_cross, left->other_load, left->other_cross, left->other_variance};
    }
    for (size_t p = 0; p < filter->laws.n_parameters; p++) {
        filter->laws.stated[p] = known->in_use && !isnan(known->std[p]) ? known->std[p] : 0.0;
    }
}
