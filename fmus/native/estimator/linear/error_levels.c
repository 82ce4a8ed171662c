#include "error_levels.h"

#include <math.h>
#include <string.h>

#include "../numerics/dense.h"
#include "../numerics/triangles.h"

/* sqrt(1/2), as Python has it. */
#define ROOT_OF_HALF 0x1.6a09e667f3bcdp-1

/* v and e with value = v 2^e, 0.5 <= v < 1, for normal numbers; frexp without libm. */
static double mantissa_of(double value, double *unit) {
    uint64_t bits;
    memcpy(&bits, &value, sizeof bits);
    const uint64_t power = (bits & 0x7FF0000000000000u) + 0x0010000000000000u; /* of 2^e */
    const uint64_t fraction = (bits & 0x000FFFFFFFFFFFFFu) | 0x3FE0000000000000u;
    double mantissa;
    memcpy(unit, &power, sizeof *unit);
    memcpy(&mantissa, &fraction, sizeof mantissa);
    return mantissa;
}

void enclosing_levels(double ratio, double *below, double *above) {
    double unit;
    const int upper = mantissa_of(ratio, &unit) >= ROOT_OF_HALF;
    *below = unit * (upper ? ROOT_OF_HALF : 0.5);
    *above = unit * (upper ? 1.0 : ROOT_OF_HALF);
}

/* Arrays of one level, for the gauges in use in their order. */
typedef struct {
    double *unresolved; /* (n) u by direction */
    double *root;       /* (n) sqrt(u) */
    double *gain;       /* (n_used, 5) G' */
    double *matrix;     /* (n, n) Q' [D V_R, D V_K] by columns, the lost gauges first */
    double *common;     /* (6 n) what the residual shows of each E of a term */
    double *head;       /* (2 n) of the QR decomposition */
    double *vector;     /* (n) */
} LevelWork;

static void set_weights(const Estimator *e, double ratio, LevelWork *work) {
    const ScaledForm *form = &e->map.form;
    for (size_t a = 0; a < e->map.n_gauges; a++) {
        const double scaled = ratio * form->singular[a];
        work->unresolved[a] = a < form->n_free ? 0.0 : 1.0 / (1.0 + scaled * scaled);
        work->root[a] = sqrt(work->unresolved[a]);
    }
}

/* Loads per strain of gauge i, whatever the lost ones read: per-direction loads times weights times V_i. */
static void plain_gain(const Estimator *e, double ratio, const LevelWork *work, size_t gauge, double *gain) {
    const size_t n = e->map.n_gauges;
    const ScaledForm *form = &e->map.form;
    const double *column = form->whitening + gauge * n;
    memset(gain, 0, N_LOADS * sizeof *gain);
    for (size_t a = 0; a < n; a++) {
        const double weight =
            a < form->n_free ? 1.0 : ratio * (ratio * form->singular[a]) * work->unresolved[a];
        for (size_t i = 0; i < N_LOADS; i++) {
            gain[i] += weight * form->load[N_LOADS * a + i] * column[a];
        }
    }
}

/* The matrix of the level, and G of the gauges in use: their own less what predicts the lost from them. */
static void set_gain(Estimator *e, double ratio, LevelWork *work) {
    const size_t n = e->map.n_gauges, n_lost = e->scaled.step.n_lost;
    const MaskedMap *m = e->masked;
    double *lost_gain = work->common; /* (n_lost, 5), until it is needed */
    for (size_t k = 0; k < n; k++) {
        const size_t gauge = k < n_lost ? e->scaled.step.lost[k] : m->used[k - n_lost];
        const double *column = e->map.form.whitening + gauge * n;
        for (size_t a = 0; a < n; a++) {
            work->matrix[k * n + a] = work->root[a] * column[a];
        }
        plain_gain(e, ratio, work, gauge, k < n_lost ? lost_gain + N_LOADS * k : work->gain + N_LOADS * (k - n_lost));
    }
    householder_columns(n, n_lost, n, work->matrix, work->head);
    for (size_t k = 0; n_lost > 0 && k < m->n_used; k++) {
        double *prediction = work->vector; /* (n_lost) */
        memcpy(prediction, work->matrix + (n_lost + k) * n, n_lost * sizeof *prediction);
        solve_triangle(n, n_lost, work->matrix, prediction);
        for (size_t j = 0; j < n_lost; j++) {
            for (size_t i = 0; i < N_LOADS; i++) {
                work->gain[N_LOADS * k + i] -= lost_gain[N_LOADS * j + i] * prediction[j];
            }
        }
    }
}

/* Bounds on z between this level and the one above: 1 / P_ii, the variance of gauge i given the others, is a concave
   function of the squared ratio, as every Schur complement of a covariance that is linear in it; so tangents bound it
   from above. P_ii falls. */
static void set_bounds(Estimator *e, const LevelWork *work, Level *level) {
    const size_t n = e->map.n_gauges, n_lost = e->scaled.step.n_lost;
    const ScaledForm *form = &e->map.form;
    double *column = work->vector;
    memset(level->checked, 0, n * sizeof *level->checked);
    memset(level->inverse, 0, n * sizeof *level->inverse);
    memset(level->slope, 0, n * sizeof *level->slope);
    memset(level->margin, 0, n * sizeof *level->margin);
    for (size_t k = 0; k < e->masked->n_used; k++) {
        const size_t gauge = e->masked->used[k];
        const double *whitening = form->whitening + gauge * n, size = e->scaled.size[gauge];
        double slope = 0.0, whole = 0.0;
        memcpy(column, work->matrix + (n_lost + k) * n, n * sizeof *column);
        memset(column, 0, n_lost * sizeof *column);
        const double precision = dot(n, column, column);
        householder_back(n, n_lost, work->matrix, work->head, column);
        for (size_t a = 0; a < n; a++) {
            slope += form->singular[a] * form->singular[a] * work->unresolved[a] * column[a] * column[a];
            whole += work->unresolved[a] * whitening[a] * whitening[a];
        }
        level->inverse[gauge] = size * size / precision;
        level->slope[gauge] = size * size * slope / (precision * precision);
        level->checked[gauge] = precision > 0.5 * form->min_precision[gauge] ? 1.0 : 0.0;
        level->margin[gauge] = sqrt(whole) / size;
    }
}

/* Add the products of gains and precision with the errors of each gauge, and with those in common. */
static void add_products(const Estimator *e, const LevelWork *work, double values[N_PAIRS][N_VALUES]) {
    const size_t n = e->map.n_gauges, n_lost = e->scaled.step.n_lost, rest = n - n_lost;
    const ScaledForm *form = &e->map.form;
    const MaskedMap *m = e->masked;
    for (size_t k = 0; k < m->n_used; k++) {
        const double *gain = work->gain + N_LOADS * k, *column = work->matrix + (n_lost + k) * n + n_lost;
        double product[N_VALUES];
        size_t at = 0;
        for (size_t i = 0; i < N_LOADS; i++) {
            for (size_t j = i; j < N_LOADS; j++) {
                product[at++] = gain[i] * gain[j];
            }
        }
        product[at] = dot(rest, column, column);
        for (size_t pair = 0; pair < N_PAIRS; pair++) {
            const double of_gauge = form->of_gauge[pair * n + m->used[k]];
            for (size_t v = 0; v < N_VALUES; v++) {
                values[pair][v] += of_gauge * product[v];
            }
        }
    }
    for (size_t term = 0; term < form->n_terms; term++) {
        double loads[6][N_LOADS] = {{0.0}};
        double *shown = work->common;
        memset(shown, 0, 6 * rest * sizeof *shown);
        for (size_t a = 0; a < 6; a++) {
            const double *error = form->common + (6 * term + a) * n;
            for (size_t k = 0; k < m->n_used; k++) {
                const double strain = error[m->used[k]], *column = work->matrix + (n_lost + k) * n + n_lost;
                for (size_t i = 0; i < N_LOADS; i++) {
                    loads[a][i] += strain * work->gain[N_LOADS * k + i];
                }
                for (size_t i = 0; i < rest; i++) {
                    shown[a * rest + i] += strain * column[i];
                }
            }
        }
        size_t pair = 0;
        for (size_t a = 0; a < 6; a++) {
            for (size_t b = a; b < 6; b++, pair++) {
                const double twice = a == b ? 1.0 : 2.0;
                size_t at = 0;
                for (size_t i = 0; i < N_LOADS; i++) {
                    for (size_t j = i; j < N_LOADS; j++) {
                        values[pair][at++] +=
                            0.5 * twice * (loads[a][i] * loads[b][j] + loads[b][i] * loads[a][j]);
                    }
                }
                values[pair][at] += twice * dot(rest, shown + a * rest, shown + b * rest);
            }
        }
    }
}

static LevelWork level_work(const Estimator *e) {
    const size_t n = e->map.n_gauges;
    double *memory = e->scaled.work[1];
    return (LevelWork){memory, memory + n, memory + 2 * n, e->scaled.work[0], memory + 7 * n, memory + 13 * n,
                       memory + 15 * n};
}

/* Gain of the further loads for gauge i of all, whatever the lost ones read. */
static void further_plain_gain(const Estimator *e, double ratio, const LevelWork *work, size_t gauge, double *gain) {
    const size_t n = e->map.n_gauges, m = e->further.map.n_loads;
    const ScaledForm *form = &e->map.form;
    const double *column = form->whitening + gauge * n;
    memset(gain, 0, m * sizeof *gain);
    for (size_t a = 0; a < n; a++) {
        const double weight = a < form->n_free ? 1.0 : ratio * (ratio * form->singular[a]) * work->unresolved[a];
        for (size_t j = 0; j < m; j++) {
            gain[j] += weight * e->further.load[a * m + j] * column[a];
        }
    }
}

/* That of the gauges in use, behind that of the lost ones. */
static void set_further_gain(Estimator *e, double ratio, const LevelWork *work) {
    const size_t n = e->map.n_gauges, n_lost = e->scaled.step.n_lost, m = e->further.map.n_loads;
    double *gain = e->further.gain;
    for (size_t k = 0; k < n; k++) {
        const size_t gauge = k < n_lost ? e->scaled.step.lost[k] : e->masked->used[k - n_lost];
        further_plain_gain(e, ratio, work, gauge, gain + k * m);
    }
    for (size_t k = n_lost; n_lost > 0 && k < n; k++) {
        double *prediction = work->vector;
        memcpy(prediction, work->matrix + k * n, n_lost * sizeof *prediction);
        solve_triangle(n, n_lost, work->matrix, prediction);
        for (size_t i = 0; i < n_lost; i++) {
            for (size_t j = 0; j < m; j++) {
                gain[k * m + j] -= gain[i * m + j] * prediction[i];
            }
        }
    }
}

void further_level(Estimator *e, double ratio, double *products) {
    const size_t n = e->map.n_gauges, n_lost = e->scaled.step.n_lost, m = e->further.map.n_loads;
    const ScaledForm *form = &e->map.form;
    LevelWork work = level_work(e);
    set_weights(e, ratio, &work);
    set_gain(e, ratio, &work);
    set_further_gain(e, ratio, &work);
    memset(products, 0, N_PAIRS * m * sizeof *products);
    for (size_t k = n_lost; k < n; k++) {
        const double *gain = e->further.gain + k * m;
        for (size_t pair = 0; pair < N_PAIRS; pair++) {
            const double of_gauge = form->of_gauge[pair * n + e->masked->used[k - n_lost]];
            for (size_t j = 0; j < m; j++) {
                products[pair * m + j] += of_gauge * (gain[j] * gain[j]);
            }
        }
    }
    for (size_t term = 0; term < form->n_terms; term++) {
        double *loads = e->further.scratch; /* (6, m) */
        memset(loads, 0, 6 * m * sizeof *loads);
        for (size_t a = 0; a < 6; a++) {
            const double *error = form->common + (6 * term + a) * n;
            for (size_t k = n_lost; k < n; k++) {
                for (size_t j = 0; j < m; j++) {
                    loads[a * m + j] += error[e->masked->used[k - n_lost]] * e->further.gain[k * m + j];
                }
            }
        }
        for (size_t a = 0, pair = 0; a < 6; a++) {
            for (size_t b = a; b < 6; b++, pair++) {
                for (size_t j = 0; j < m; j++) {
                    products[pair * m + j] += (a == b ? 1.0 : 2.0) * (loads[a * m + j] * loads[b * m + j]);
                }
            }
        }
    }
}

static void compute(Estimator *e, double ratio, Level *level) {
    LevelWork work = level_work(e);
    double values[N_PAIRS][N_VALUES] = {{0.0}};
    set_weights(e, ratio, &work);
    set_gain(e, ratio, &work);
    set_bounds(e, &work, level);
    if (e->map.form.has_errors) {
        add_products(e, &work, values);
    }
    dense_panels(N_VALUES, N_PAIRS, &values[0][0], 1, N_VALUES, level->products);
    level->ratio = ratio;
    level->has_further = 0;
}

const Level *error_level(Estimator *e, double ratio, const Level *other) {
    Levels *levels = &e->levels[e->masked - e->cache];
    for (size_t k = 0; k < CACHED_LEVELS; k++) {
        if (levels->level[k].ratio == ratio) {
            return &levels->level[k];
        }
    }
    levels->next += &levels->level[levels->next] == other;
    Level *level = &levels->level[levels->next % CACHED_LEVELS];
    levels->next = (levels->next + 1) % CACHED_LEVELS;
    compute(e, ratio, level);
    return level;
}
