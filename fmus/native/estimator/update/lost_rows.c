#include "lost_rows.h"

#include <math.h>
#include <string.h>

#include "../numerics/arrays.h"
#include "../numerics/dense.h"
#include "../numerics/triangles.h"

size_t lost_rows_doubles(size_t n) {
    return dense_rows(n) + n * (n + 1) + 2 * n;
}

void lost_rows_arrays(size_t n, LostRows *rows, double **doubles) {
    rows->root = taken(doubles, dense_rows(n));
    rows->matrix = taken(doubles, n * (n + 1));
    rows->head = taken(doubles, 2 * n);
}

static void decompose(const Scaled *scaled, const double *unresolved, const LostRows *rows) {
    const size_t n = scaled->map->n_gauges, n_lost = scaled->step.n_lost;
    double *of_mean = rows->matrix + n_lost * n;
    for (size_t a = 0; a < n; a++) {
        rows->root[a] = sqrt(unresolved[a]);
        of_mean[a] = rows->root[a] * scaled->step.of_mean[a];
    }
    for (size_t j = 0; j < n_lost; j++) {
        const double *column = scaled->map->form.whitening + scaled->step.lost[j] * n;
        for (size_t a = 0; a < n; a++) {
            rows->matrix[j * n + a] = rows->root[a] * column[a];
        }
    }
    householder_columns(scaled->wide, n, n_lost, n_lost + 1, rows->matrix, rows->head);
}

/* Q' D^-1/2 times a vector of directions: the first n_lost elements hold what lost gauges say of it. */
static void turn(const Scaled *scaled, const LostRows *rows, const double *vector, double *turned) {
    const size_t n = scaled->map->n_gauges;
    for (size_t a = 0; a < n; a++) {
        turned[a] = rows->root[a] * vector[a];
    }
    householder_forward(n, scaled->step.n_lost, rows->matrix, rows->head, turned);
}

/* Complete a vector of directions of the gauges in use by the prediction of the lost ones, from the head of it turned. */
static void complete(const Scaled *scaled, double *turned, double *vector) {
    const size_t n = scaled->map->n_gauges, n_lost = scaled->step.n_lost;
    solve_triangle(n, n_lost, scaled->step.gain.matrix, turned);
    for (size_t j = 0; j < n_lost; j++) {
        const double *column = scaled->map->form.whitening + scaled->step.lost[j] * n;
        for (size_t a = 0; a < n; a++) {
            vector[a] -= turned[j] * column[a];
        }
    }
}

/* Y = V' D^-1/2 Q of the lost gauges: what they take from the precision of all. */
static void set_y(Scaled *scaled) {
    const ScaledStep *step = &scaled->step;
    const size_t n = scaled->map->n_gauges;
    double *column = step->scratch[1];
    for (size_t j = 0; j < step->n_lost; j++) {
        memset(column, 0, n * sizeof *column);
        column[j] = 1.0;
        householder_back(n, step->n_lost, step->truth.matrix, step->truth.head, column);
        for (size_t a = 0; a < n; a++) {
            column[a] *= step->truth.root[a];
        }
        dense_times(scaled->wide, n, n, scaled->columns, column, step->y + j * dense_rows(n));
    }
}

static void set_growth(Scaled *scaled) {
    const ScaledStep *step = &scaled->step;
    const ScaledForm *form = &scaled->map->form;
    const size_t n = scaled->map->n_gauges, n_lost = step->n_lost;
    memset(step->growth, 0, N_LOADS * n_lost * sizeof *step->growth);
    for (size_t j = 0; j < n_lost; j++) {
        const double *column = form->whitening + step->lost[j] * n;
        for (size_t a = 0; a < n; a++) {
            for (size_t i = 0; i < N_LOADS; i++) {
                step->growth[i * n_lost + j] += step->weight[a] * form->load[N_LOADS * a + i] * column[a];
            }
        }
    }
    for (size_t i = 0; i < N_LOADS; i++) {
        solve_transposed(n, n_lost, step->gain.matrix, step->growth + i * n_lost);
    }
}

void lost_rows_prepare(Scaled *scaled) {
    ScaledStep *step = &scaled->step;
    decompose(scaled, step->unresolved, &step->truth);
    if (scaled->of_gain != NULL) {
        decompose(scaled, scaled->of_gain, &step->gain);
    }
    complete(scaled, step->gain.matrix + step->n_lost * scaled->map->n_gauges, scaled->mean_left);
    set_growth(scaled);
    set_y(scaled);
}

void lost_rows_condition(Scaled *scaled) {
    ScaledStep *step = &scaled->step;
    const size_t n = scaled->map->n_gauges, n_lost = step->n_lost;
    double *turned = step->scratch[0], *of_gain = step->scratch[1];
    turn(scaled, &step->truth, step->w, turned);
    if (scaled->of_gain != NULL) {
        turn(scaled, &step->gain, step->w, of_gain);
    } else {
        memcpy(of_gain, turned, n_lost * sizeof *of_gain);
    }
    step->chi_square = dot(n - n_lost, turned + n_lost, turned + n_lost);
    memset(turned, 0, n_lost * sizeof *turned);
    householder_back(n, n_lost, step->truth.matrix, step->truth.head, turned);
    for (size_t a = 0; a < n; a++) {
        step->x[a] = step->truth.root[a] * turned[a];
    }
    complete(scaled, of_gain, step->w);
}

void add_products(const double *first, const double *second, double products[N_VALUES]) {
    for (size_t i = 0, k = 0; i < N_LOADS; i++) {
        for (size_t j = i; j < N_LOADS; j++, k++) {
            products[k] += first[i] * first[j] + second[i] * second[j];
        }
    }
}

/* Joseph's form. Lost gauges take `shift` from the gain of each direction. */
void lost_rows_products(Scaled *scaled, double products[N_VALUES]) {
    const size_t n = scaled->map->n_gauges;
    const ScaledForm *form = &scaled->map->form;
    const ScaledStep *step = &scaled->step;
    double *shift[N_LOADS], left[2][N_LOADS];
    for (size_t i = 0; i < N_LOADS; i++) {
        shift[i] = scaled->shift + i * n;
        memset(shift[i], 0, n * sizeof *shift[i]);
        memcpy(shift[i], step->growth + i * step->n_lost, step->n_lost * sizeof *shift[i]);
        householder_back(n, step->n_lost, step->gain.matrix, step->gain.head, shift[i]);
    }
    memset(products, 0, N_VALUES * sizeof *products);
    for (size_t a = 0; a < n; a++) {
        for (size_t i = 0; i < N_LOADS; i++) {
            const double taken_off = step->gain.root[a] * shift[i][a];
            left[0][i] = form->noise_left[N_LOADS * a + i] - taken_off;
            left[1][i] = form->prior_left[N_LOADS * a + i] + taken_off * form->singular[a];
        }
        add_products(left[0], left[1], products);
    }
}
