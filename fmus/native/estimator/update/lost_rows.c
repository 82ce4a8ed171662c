/* Gauges that are lost, without a new decomposition of the map.

   n gauges have n directions; V (n, n) turns residuals r of strain into directions, u (n) is `unresolved`, 0 for
   free states. With all gauges

       w = V r,   chi-square = |D^-1/2 w|^2,   P = V' D^-1 V,   D^-1 = diag(u).

   The reading of a lost gauge is unknown. V_L (n, n_lost) are the columns of V that belong to lost gauges, and w is
   formed with residuals of 0 for them; the true residuals are -e. The best e makes chi-square smallest, an ordinary
   least-squares problem:

       min over e of | D^-1/2 (w - V_L e) |^2,     D^-1/2 V_L = Q [R; 0]          (decompose)

       e          = R^-1 (Q' D^-1/2 w)_head,       w becomes w - V_L e            (predict_lost)
       chi-square = | (Q' D^-1/2 w)_tail |^2,      x = D^-1/2 Q [0; tail]         (lost_rows_condition)
       P          = P_all - Y Y',                  Y = V' D^-1/2 Q_head           (set_y)
       gain       = G_all - B Y',                  B = F W V_L R^-1               (set_growth)
       covariance = covariance_all + B B'

   head is the first n_lost elements, tail the rest; F (5, n) are the loads of each direction and W = diag(weight),
   so that G_all = F W V. (R' R)^-1 is the covariance of e. R is singular where the other gauges do not identify a
   state; prepared.c refuses such a set before.

   In form "absolute" with gamma other than 1 the gain has another prior than the truth, so it has a u of its own:
   qr_of_gain decomposes with that one, qr_of_truth with the true one, and the covariance follows from Joseph's form
   (lost_rows_products).

   docs/explanation/theory.md, "Missing and suspect gauges", has the same result by P: e = P_LL^-1 (P r)_L, as P_LL =
   R' R. strainfmu/estimator/reference/update.py decomposes the model for the gauges in use instead; the tests
   compare the two. */

#include "update.h"

#include <math.h>
#include <string.h>

/* Q and R of D^-1/2 V_L for these u. One more column, D^-1/2 V (m - d_0), is rotated along with them: the mean strain
   of lost gauges is predicted like their readings. */
static void decompose(const Scaled *scaled, const double *unresolved, const LostRows *rows) {
    const size_t n = scaled->map->n_gauges, n_lost = scaled->step.n_lost;
    double *of_mean = rows->matrix + n_lost * n;
    for (size_t a = 0; a < n; a++) {
        rows->root[a] = sqrt(unresolved[a]);
        of_mean[a] = rows->root[a] * scaled->step.of_mean[a];
    }
    for (size_t j = 0; j < n_lost; j++) {
        const double *column = scaled->map->made->whitening + scaled->step.lost[j] * n;
        for (size_t a = 0; a < n; a++) {
            rows->matrix[j * n + a] = rows->root[a] * column[a];
        }
    }
    householder_columns(scaled->wide, n, n_lost, n_lost + 1, rows->matrix, rows->head);
}

/* Q' D^-1/2 times a vector of directions: the first n_lost elements determine e, the others are free of the lost
   gauges. */
static void rotate(const Scaled *scaled, const LostRows *rows, const double *vector, double *rotated) {
    const size_t n = scaled->map->n_gauges;
    for (size_t a = 0; a < n; a++) {
        rotated[a] = rows->root[a] * vector[a];
    }
    householder_forward(n, scaled->step.n_lost, rows->matrix, rows->head, rotated);
}

/* w - V_L e. The head of `rotated` becomes e. */
static void predict_lost(const Scaled *scaled, double *rotated, double *vector) {
    const size_t n = scaled->map->n_gauges, n_lost = scaled->step.n_lost;
    solve_triangle(n, n_lost, scaled->step.qr_of_gain.matrix, rotated);
    for (size_t j = 0; j < n_lost; j++) {
        const double *column = scaled->map->made->whitening + scaled->step.lost[j] * n;
        for (size_t a = 0; a < n; a++) {
            vector[a] -= rotated[j] * column[a];
        }
    }
}

/* Column j of Y is V' D^-1/2 Q times the unit vector j. */
static void set_y(Scaled *scaled) {
    const ScaledStep *step = &scaled->step;
    const size_t n = scaled->map->n_gauges, whole = dense_rows(n);
    for (size_t j = 0; j < step->n_lost; j++) {
        double *column = scaled->of_lost + j * whole;
        memset(column, 0, n * sizeof *column);
        column[j] = 1.0;
        householder_back(scaled->wide, n, step->n_lost, step->qr_of_truth.matrix, step->qr_of_truth.head, column);
        for (size_t a = 0; a < n; a++) {
            column[a] *= step->qr_of_truth.root[a];
        }
    }
    dense_times_many(scaled->wide, n, n, scaled->columns, step->n_lost, scaled->of_lost, whole, step->y, whole);
}

/* B' = R'^-1 V_L' W F', a row of B for each load. */
static void set_growth(const Scaled *scaled) {
    const ScaledStep *step = &scaled->step;
    const size_t n = scaled->map->n_gauges, n_loads = scaled->n_loads, n_lost = step->n_lost;
    memset(step->growth, 0, n_loads * n_lost * sizeof *step->growth);
    for (size_t j = 0; j < n_lost; j++) {
        const double *column = scaled->map->made->whitening + step->lost[j] * n;
        for (size_t a = 0; a < n; a++) {
            const double weighted = step->weight[a] * column[a], *load = scaled->map->made->load + a * n_loads;
            for (size_t k = 0; k < n_loads; k++) {
                step->growth[k * n_lost + j] += weighted * load[k];
            }
        }
    }
    for (size_t k = 0; k < n_loads; k++) {
        solve_transposed(n, n_lost, step->qr_of_gain.matrix, step->growth + k * n_lost);
    }
}

void lost_rows_take(const Scaled *scaled, size_t k, double *restrict gain) {
    const ScaledStep *step = &scaled->step;
    const size_t n = scaled->map->n_gauges;
    for (size_t j = 0; j < step->n_lost; j++) {
        add_times(n, -step->growth[k * step->n_lost + j], step->y + j * dense_rows(n), gain);
    }
}

void lost_rows_prepare(Scaled *scaled) {
    ScaledStep *step = &scaled->step;
    decompose(scaled, step->unresolved, &step->qr_of_truth);
    if (scaled->of_gain != NULL) {
        decompose(scaled, scaled->of_gain, &step->qr_of_gain);
    }
    /* The mean strain comes first: of_mean of the lost gauges is part of the derivative by q_inf. */
    predict_lost(scaled, step->qr_of_gain.matrix + step->n_lost * scaled->map->n_gauges, scaled->mean_left);
    set_growth(scaled);
    set_y(scaled);
}

void lost_rows_condition(Scaled *scaled) {
    ScaledStep *step = &scaled->step;
    const size_t n = scaled->map->n_gauges, n_lost = step->n_lost;
    double *rotated = step->scratch[0], *of_gain = step->scratch[1];
    rotate(scaled, &step->qr_of_truth, step->w, rotated);
    if (scaled->of_gain != NULL) {
        rotate(scaled, &step->qr_of_gain, step->w, of_gain);
    } else {
        memcpy(of_gain, rotated, n_lost * sizeof *of_gain);
    }
    /* The tail is D^-1/2 (w - V_L e) in rotated coordinates: its square is chi-square, and rotated back it is D^1/2 x. */
    step->chi_square = dot(n - n_lost, rotated + n_lost, rotated + n_lost);
    memset(rotated, 0, n_lost * sizeof *rotated);
    householder_back(scaled->wide, n, n_lost, step->qr_of_truth.matrix, step->qr_of_truth.head, rotated);
    for (size_t a = 0; a < n; a++) {
        step->x[a] = step->qr_of_truth.root[a] * rotated[a];
    }
    predict_lost(scaled, of_gain, step->w);
}

void add_products(const double *first, const double *second, double products[N_VALUES]) {
    for (size_t i = 0, k = 0; i < N_LOADS; i++) {
        for (size_t j = i; j < N_LOADS; j++, k++) {
            products[k] += first[i] * first[j] + second[i] * second[j];
        }
    }
}

/* Joseph's form of the covariance, docs/explanation/theory.md, "What a sigma is made of": it holds for any gain. The
   gain k_a of direction a changes by -(B Q_head')_a D_aa^-1/2, which is `taken_off` here; the noise leaves k_a -
   b_a, the prior G_a - k_a S_a (added_noise.c). */
void lost_rows_products(Scaled *scaled, double products[N_VALUES]) {
    const size_t n = scaled->map->n_gauges;
    const NoiseMatrices *made = scaled->map->made;
    const ScaledStep *step = &scaled->step;
    double *shift[N_LOADS], left[2][N_LOADS];
    for (size_t i = 0; i < N_LOADS; i++) {
        shift[i] = scaled->shift + i * n;
        memset(shift[i], 0, n * sizeof *shift[i]);
        memcpy(shift[i], step->growth + i * step->n_lost, step->n_lost * sizeof *shift[i]);
        householder_back(scaled->wide, n, step->n_lost, step->qr_of_gain.matrix, step->qr_of_gain.head, shift[i]);
    }
    memset(products, 0, N_VALUES * sizeof *products);
    for (size_t a = 0; a < n; a++) {
        for (size_t i = 0; i < N_LOADS; i++) {
            const double taken_off = step->qr_of_gain.root[a] * shift[i][a];
            left[0][i] = made->noise_left[N_LOADS * a + i] - taken_off;
            left[1][i] = made->prior_left[N_LOADS * a + i] + taken_off * made->singular[a];
        }
        add_products(left[0], left[1], products);
    }
}
