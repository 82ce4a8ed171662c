#include "scaled_form.h"

#include <math.h>
#include <string.h>

#include "../numerics/arrays.h"
#include "../numerics/dense.h"
#include "../numerics/triangles.h"
#include "../numerics/wide.h"
#include "current_errors.h"

/* Places of the entries of a symmetric (5, 5) matrix, row by row from the diagonal. */
static const unsigned char ENTRY[15][2] = {{0, 0}, {0, 1}, {0, 2}, {0, 3}, {0, 4}, {1, 1}, {1, 2}, {1, 3},
                                           {1, 4}, {2, 2}, {2, 3}, {2, 4}, {3, 3}, {3, 4}, {4, 4}};

static void set_symmetric(const double *entries, double *matrix) {
    for (size_t k = 0; k < 15; k++) {
        matrix[ENTRY[k][0] * N_LOADS + ENTRY[k][1]] = matrix[ENTRY[k][1] * N_LOADS + ENTRY[k][0]] = entries[k];
    }
}

size_t scaled_doubles(const Map *map, size_t n_other) {
    const size_t n = map->n_gauges, whole = dense_rows(n), narrow = narrow_rows(n);
    const size_t columns = dense_columns(n);
    const size_t tables = (3 * whole + N_VALUES + ROWS + narrow / 2) * columns + n + 3 * whole;
    const size_t step = (8 + n) * whole + narrow + narrow + n * (n + 2) + 2 * n + N_LOADS * n;
    return tables + step + current_errors_doubles(map, n_other);
}

size_t scaled_indices(const Map *map) {
    return map->n_gauges;
}

void scaled_arrays(Scaled *scaled, double **doubles, size_t **indices) {
    const size_t n = scaled->map->n_gauges, columns = dense_columns(n), whole = dense_rows(n), narrow = narrow_rows(n);
    ScaledStep *step = &scaled->step;
    scaled->rows = taken(doubles, whole * columns);
    scaled->columns = taken(doubles, whole * columns);
    scaled->square = taken(doubles, whole * columns);
    scaled->squares = taken(doubles, N_VALUES * columns);
    scaled->loads = taken(doubles, ROWS * columns);
    scaled->screen = (float *)(void *)taken(doubles, narrow * columns / 2);
    scaled->mean = taken(doubles, whole);
    step->unresolved = taken(doubles, whole);
    step->weight = taken(doubles, whole);
    step->spread = taken(doubles, whole);
    step->w = taken(doubles, whole);
    step->of_mean = taken(doubles, whole);
    step->x = taken(doubles, whole);
    step->scratch[0] = taken(doubles, whole);
    step->scratch[1] = taken(doubles, whole);
    step->bound = taken(doubles, narrow);
    step->narrow = (float *)(void *)taken(doubles, narrow / 2);
    step->narrow_z = (float *)(void *)taken(doubles, narrow / 2);
    scaled->size = taken(doubles, n);
    scaled->own_mean = taken(doubles, whole);
    scaled->residual = taken(doubles, whole);
    step->y = taken(doubles, n * whole);
    step->matrix = taken(doubles, n * (n + 2));
    step->head = taken(doubles, 2 * n);
    step->growth = taken(doubles, N_LOADS * n);
    current_errors_arrays(scaled, doubles);
    step->lost = *indices;
    *indices += n;
}

void scaled_prepare(Scaled *scaled) {
    const size_t n = scaled->map->n_gauges;
    const ScaledForm *form = &scaled->map->form;
    double *scale = scaled->residual;
    dense_panels(n, n, form->whitening, 1, n, scaled->rows);
    dense_panels(n, n, form->whitening, n, 1, scaled->columns);
    for (size_t k = 0; k < dense_rows(n) * dense_columns(n); k++) {
        scaled->square[k] = scaled->columns[k] * scaled->columns[k];
    }
    dense_panels(N_LOADS, n, form->load, 1, N_LOADS, scaled->loads);
    for (size_t i = 0; i < n; i++) {
        const double *column = form->whitening + i * n;
        scaled->size[i] = sqrt(dot(n, column, column));
        scale[i] = 1.0 / scaled->size[i];
    }
    narrow_panels(n, n, form->whitening, n, 1, scale, scaled->screen);
    for (size_t a = 0; a < n; a++) {
        const double *load = form->load + N_LOADS * a;
        for (size_t k = 0; k < N_VALUES; k++) {
            const double square = k < 15 ? load[ENTRY[k][0]] * load[ENTRY[k][1]] : 0.0;
            scaled->squares[(k / ROWS) * ROWS * dense_columns(n) + a * ROWS + k % ROWS] = square;
        }
    }
    memcpy(scaled->own_mean, form->mean_strain, n * sizeof *scaled->own_mean);
    dense_times(0, n, n, scaled->rows, scaled->own_mean, scaled->mean);
    memset(scaled->residual, 0, n * sizeof *scaled->residual);
    current_errors_prepare(scaled);
}

/* u and what follows from it. */
EVERYWHERE void set_weights(const Scaled *scaled, ScaledStep *step) {
    const ScaledForm *form = &scaled->map->form;
    const double s = step->ratio;
    const size_t n = scaled->map->n_gauges;
    for (size_t a = 0; a < n; a++) {
        const double size = s * form->singular[a], unresolved = 1.0 / (1.0 + size * size);
        step->unresolved[a] = unresolved;
        step->weight[a] = s * size * unresolved;
        step->spread[a] = s * s * unresolved;
    }
    for (size_t a = 0; a < form->n_free; a++) {
        step->unresolved[a] = 0.0;
        step->weight[a] = step->spread[a] = 1.0;
    }
}

/* V r and V (m - d_0), the residuals of lost gauges being 0. */
EVERYWHERE void set_residual(Scaled *scaled, ScaledStep *step, const double *strain) {
    const size_t n = scaled->map->n_gauges;
    const ScaledForm *form = &scaled->map->form;
    for (size_t i = 0; i < n; i++) {
        scaled->residual[i] = strain[i] - (form->fixed_strain[i] + step->ratio * form->mean_strain[i]);
    }
    step->n_lost = 0;
    if (scaled->step.masked->n_used == n) {
        memcpy(step->of_mean, scaled->mean, n * sizeof *step->of_mean);
    } else {
        memcpy(scaled->own_mean, form->mean_strain, n * sizeof *scaled->own_mean);
        for (size_t i = 0; i < n; i++) {
            if (!scaled->step.masked->mask[i]) {
                scaled->residual[i] = scaled->own_mean[i] = 0.0;
                step->lost[step->n_lost++] = i;
            }
        }
        dense_times(scaled->wide, n, n, scaled->rows, scaled->own_mean, step->of_mean);
    }
    dense_times(scaled->wide, n, n, scaled->rows, scaled->residual, step->w);
}

/* Add V_R times r to a vector of directions. */
static void add_lost(const Scaled *scaled, const double *r, double factor, double *vector) {
    const size_t n = scaled->map->n_gauges;
    for (size_t j = 0; j < scaled->step.n_lost; j++) {
        const double *column = scaled->map->form.whitening + scaled->step.lost[j] * n, size = factor * r[j];
        for (size_t a = 0; a < n; a++) {
            vector[a] += size * column[a];
        }
    }
}

/* Y = V' D^1/2 Q of the lost gauges: what they take from the precision of all. */
static void set_y(Scaled *scaled, ScaledStep *step, const double *root) {
    const size_t n = scaled->map->n_gauges;
    double *column = step->scratch[1];
    for (size_t j = 0; j < step->n_lost; j++) {
        memset(column, 0, n * sizeof *column);
        column[j] = 1.0;
        householder_back(n, step->n_lost, step->matrix, step->head, column);
        for (size_t a = 0; a < n; a++) {
            column[a] *= root[a];
        }
        dense_times(scaled->wide, n, n, scaled->columns, column, step->y + j * dense_rows(n));
    }
}

/* Predict the lost gauges: complete w and of_mean, and set chi-square, x, Y and B. */
static void predict_lost(Scaled *scaled, ScaledStep *step) {
    const size_t n = scaled->map->n_gauges, n_lost = step->n_lost;
    const ScaledForm *form = &scaled->map->form;
    double *root = step->scratch[0], *of_w = step->matrix + n_lost * n, *of_mean = of_w + n;
    for (size_t a = 0; a < n; a++) {
        root[a] = sqrt(step->unresolved[a]);
        of_w[a] = root[a] * step->w[a];
        of_mean[a] = root[a] * step->of_mean[a];
    }
    memset(step->growth, 0, N_LOADS * n_lost * sizeof *step->growth);
    for (size_t j = 0; j < n_lost; j++) {
        const double *column = form->whitening + step->lost[j] * n;
        for (size_t a = 0; a < n; a++) {
            step->matrix[j * n + a] = root[a] * column[a];
            for (size_t i = 0; i < N_LOADS; i++) {
                step->growth[i * n_lost + j] += step->weight[a] * form->load[N_LOADS * a + i] * column[a];
            }
        }
    }
    householder_columns(scaled->wide, n, n_lost, n_lost + 2, step->matrix, step->head);
    step->chi_square = dot(n - n_lost, of_w + n_lost, of_w + n_lost);
    double *whitened = step->scratch[1];
    memcpy(whitened, of_w, n * sizeof *whitened);
    memset(whitened, 0, n_lost * sizeof *whitened);
    householder_back(n, n_lost, step->matrix, step->head, whitened);
    for (size_t a = 0; a < n; a++) {
        step->x[a] = root[a] * whitened[a];
    }
    solve_triangle(n, n_lost, step->matrix, of_w);
    solve_triangle(n, n_lost, step->matrix, of_mean);
    add_lost(scaled, of_w, -1.0, step->w);
    add_lost(scaled, of_mean, -1.0, step->of_mean);
    for (size_t i = 0; i < N_LOADS; i++) {
        solve_transposed(n, n_lost, step->matrix, step->growth + i * n_lost);
    }
    set_y(scaled, step, root);
}

/* Loads, their derivative by q_inf, and their covariance but for errors at the current strain. */
EVERYWHERE void set_loads(Scaled *scaled, ScaledStep *step) {
    const size_t n = scaled->map->n_gauges;
    const ScaledForm *form = &scaled->map->form;
    const double s = step->ratio, nominal = scaled->map->dynamic_pressure;
    double loads[ROWS], of_mean[ROWS], squares[N_VALUES];
    for (size_t a = 0; a < n; a++) {
        step->scratch[0][a] = step->weight[a] * step->w[a];
        step->scratch[1][a] = step->weight[a] * step->of_mean[a];
    }
    dense_times(scaled->wide, ROWS, n, scaled->loads, step->scratch[0], loads);
    dense_times(scaled->wide, ROWS, n, scaled->loads, step->scratch[1], of_mean);
    dense_times(scaled->wide, N_VALUES, n, scaled->squares, step->spread, squares);
    set_symmetric(squares, step->covariance);
    for (size_t i = 0; i < N_LOADS; i++) {
        step->loads[i] = form->fixed_load[i] + s * form->load_of_mean[i] + loads[i];
        step->per_pressure[i] = (form->load_of_mean[i] - of_mean[i]) / nominal;
    }
    for (size_t k = 0; k < N_LOADS * N_LOADS; k++) {
        step->covariance[k] += s * s * form->unseen[k];
    }
    for (size_t i = 0; step->n_lost > 0 && i < N_LOADS; i++) {
        for (size_t j = 0; j <= i; j++) {
            const double more =
                dot(step->n_lost, step->growth + i * step->n_lost, step->growth + j * step->n_lost);
            step->covariance[i * N_LOADS + j] += more;
            step->covariance[j * N_LOADS + i] += i == j ? 0.0 : more;
        }
    }
}

/* Errors in proportion to strain at the current one: what they add to covariance and expected chi-square. */
static void add_errors(Scaled *scaled, ScaledStep *step) {
    const double s = step->ratio;
    const int freedom = scaled->map->degrees_of_freedom - (int)step->n_lost;
    step->expected_ratio = 1.0;
    if (!scaled->map->form.has_errors) {
        return;
    }
    current_errors_set_powers(scaled);
    if (step->n_lost > 0) {
        current_errors_take_lost(scaled);
    }
    const double trace = current_errors_add(scaled, step->covariance);
    if (freedom > 0) {
        const double least = scaled->map->form.min_expected_ratio;
        step->expected_ratio = 1.0 + s * s * trace / (double)freedom;
        step->expected_ratio = step->expected_ratio > least ? step->expected_ratio : least;
    }
}

/* Inlined with all but what lost gauges need, so that the loops over directions are compiled for AVX2 too. */
EVERYWHERE void condition(Scaled *scaled, const double *strain) {
    ScaledStep *step = &scaled->step;
    const size_t n = scaled->map->n_gauges;
    step->ratio = step->pressure / scaled->map->dynamic_pressure;
    set_weights(scaled, step);
    set_residual(scaled, step, strain);
    if (step->n_lost > 0) {
        predict_lost(scaled, step);
    } else {
        for (size_t a = 0; a < n; a++) {
            step->x[a] = step->unresolved[a] * step->w[a];
        }
        step->chi_square = dot(n, step->x, step->w);
    }
    set_loads(scaled, step);
    step->interval = current_interval(scaled, step->ratio);
    add_errors(scaled, step);
}

#if HAS_AVX2
AVX2 static void condition_avx2(Scaled *scaled, const double *strain) {
    condition(scaled, strain);
}
#endif

void scaled_condition(Scaled *scaled, const MaskedMap *masked, double pressure, const double *strain) {
    scaled->step.masked = masked;
    scaled->step.pressure = pressure;
    CHOSEN(scaled->wide, condition)(scaled, strain);
}

void scaled_standardised_residuals(Scaled *scaled, double *z) {
    const size_t n = scaled->map->n_gauges;
    ScaledStep *step = &scaled->step;
    const MaskedMap *m = step->masked;
    double *slope = step->scratch[0], *precisions = step->scratch[1];
    dense_times(scaled->wide, n, n, scaled->columns, step->x, slope);
    dense_times(scaled->wide, n, n, scaled->square, step->unresolved, precisions);
    for (size_t j = 0; j < step->n_lost; j++) {
        const double *y = step->y + j * dense_rows(n);
        for (size_t i = 0; i < n; i++) {
            precisions[i] -= y[i] * y[i];
        }
    }
    for (size_t k = 0; k < m->n_used; k++) {
        const size_t gauge = m->used[k];
        const double precision = precisions[gauge];
        const int checked = precision > scaled->map->form.min_precision[gauge];
        z[gauge] = checked ? slope[gauge] / sqrt(precision) : 0.0;
    }
}

/* Row j of B, other_loads->growth: what the lost gauges add to the variance is its square. */
static void set_growth(const Scaled *scaled, size_t j) {
    const ScaledStep *step = &scaled->step;
    const size_t n = scaled->map->n_gauges, m = scaled->other_loads->map.n_loads;
    double *growth = scaled->other_loads->growth;
    for (size_t k = 0; k < step->n_lost; k++) {
        const double *column = scaled->map->form.whitening + step->lost[k] * n;
        growth[k] = 0.0;
        for (size_t a = 0; a < n; a++) {
            growth[k] += step->weight[a] * scaled->other_loads->load[a * m + j] * column[a];
        }
    }
    solve_transposed(n, step->n_lost, step->matrix, growth);
}

void scaled_other_load(const Scaled *scaled, size_t j, double *value, double *variance, double *per_pressure) {
    const OtherLoads *other_loads = scaled->other_loads;
    const ScaledStep *step = &scaled->step;
    const size_t n = scaled->map->n_gauges, m = other_loads->map.n_loads;
    const double s = step->ratio;
    double sum = 0.0, of_mean = 0.0, spread = 0.0;
    for (size_t a = 0; a < n; a++) {
        const double load = other_loads->load[a * m + j], weighted = step->weight[a] * load;
        sum += weighted * step->w[a];
        of_mean += weighted * step->of_mean[a];
        spread += step->spread[a] * (load * load);
    }
    *value = other_loads->map.fixed[j] + s * other_loads->map.of_mean[j] + sum;
    *per_pressure = (other_loads->map.of_mean[j] - of_mean) / scaled->map->dynamic_pressure;
    set_growth(scaled, j);
    *variance = spread + s * s * other_loads->unseen[j] + dot(step->n_lost, other_loads->growth, other_loads->growth);
    if (scaled->map->form.has_errors) {
        *variance += s * s * current_errors_of_other(scaled, j, other_loads->growth);
    }
    *variance = *variance > 0.0 ? *variance : 0.0;
}

