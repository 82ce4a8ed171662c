/* The step of a linear map: loads, covariance and residuals of one sample at any dynamic pressure.

   With s = q_inf / q_nominal, n gauges and n directions, a sample of strain d (n) has the model eq:scaled-model

       d = d_0 + s (m + A x + N y) + e_g,      f = f_0 + s (f_mean + M x + M_N y),

   y standard normal, x free (Case 1) or standard normal (Case 2). added_noise.c has decomposed it once for
   all s (eq:scaled-decomposition): V (n, n) whitens, S (n) is signal over noise of each direction at s = 1, F (5, n)
   are the loads of each, R (5, 5) the covariance of loads that no strain shows. Then

       r = d - d_0 - s m,      w = V r,      u_a = 1 / (1 + s^2 S_a^2),  0 where direction a is a free state
       f = f_0 + s f_mean + F W w,        W = diag(s^2 S u), 1 for free states          (eq:scaled-loads)
       cov f = s^2 R + F diag(s^2 u) F',  1 instead of s^2 u for free states
       chi-square = sum of u w^2,         P = V' diag(u) V                              (eq:scaled-chi-square)
       z_i = (V' x)_i / sqrt(P_ii),       x = u w                                       (residuals)
       df/dq_inf = (f_mean - F W V m) / q_nominal    at fixed weights: the mean alone follows q_inf

   In form "absolute" s is 1, F is the gain of each direction itself (W = 1), and its covariance is Joseph's form,
   sum of (k - b)(k - b)' + (G - k S)(G - k S)': added_noise.c. Errors at the current strain add s^2 G D G' to cov f
   and s^2 tr(P D) to the expected chi-square: current_errors.c. Lost gauges: lost_rows.c.

   What depends on s and the gauges in use alone stays in the step and is made again where either changes.
   docs/explanation/dynamic_pressure.md, "Weights at any dynamic pressure", derives the equations;
   strainfmu/estimator/reference/linear.py has them in numpy. */

#include "update.h"

#include <math.h>
#include <string.h>

/* Whether the gain has another prior of the states than the truth: gamma other than 1, possible in form "absolute"
   alone. */
static int gain_differs(const Map *map) {
    return !map->form.follows_pressure && map->known_prior && map->regularisation != 1.0;
}

void scaled_arrays(Scaled *scaled, Room *room) {
    const size_t n = scaled->map->n_gauges, columns = dense_columns(n), whole = dense_rows(n), narrow = narrow_rows(n);
    ScaledStep *step = &scaled->step;
    if (scaled->map->has_low_rank) {
        low_rank_arrays(scaled, room);
        return;
    }
    TAKE(room, whole * columns, &scaled->rows, &scaled->columns, &scaled->square);
    scaled->squares = taken(room, N_VALUES * columns);
    scaled->loads = taken(room, ROWS * columns);
    scaled->screen = piece(room, narrow * columns, sizeof *scaled->screen);
    TAKE(room, whole, &scaled->mean, &step->unresolved, &step->weight, &step->spread, &step->w, &scaled->mean_left,
         &step->x, &step->scratch[0], &step->scratch[1]);
    step->bound = taken(room, narrow);
    step->narrow = piece(room, narrow, sizeof *step->narrow);
    step->narrow_z = piece(room, narrow, sizeof *step->narrow_z);
    TAKE(room, n, &step->z, &scaled->size);
    TAKE(room, whole, &scaled->own_mean, &scaled->residual);
    TAKE(room, n * whole, &step->y, &scaled->of_lost);
    TAKE(room, whole, &step->qr_of_truth.root, &step->qr_of_gain.root);
    TAKE(room, n * (n + 1), &step->qr_of_truth.matrix, &step->qr_of_gain.matrix);
    TAKE(room, 2 * n, &step->qr_of_truth.head, &step->qr_of_gain.head);
    step->growth = taken(room, scaled->n_loads * n);
    scaled->shift = taken(room, N_LOADS * n);
    scaled->of_gain = taken(room, n);
    if (!gain_differs(scaled->map)) {
        scaled->of_gain = NULL;
        step->qr_of_gain = step->qr_of_truth;
    }
    current_errors_arrays(scaled, room);
    step->lost = piece(room, n, sizeof *step->lost);
}

/* The 15 entries of F_a F_a', or of (k - b)(k - b)' + (G - k S)(G - k S)' in form "absolute": the covariance is
   their sum over the directions with weights `spread`, one product of a matrix by a vector. */
static void set_products(const Scaled *scaled, size_t a, double products[N_VALUES]) {
    const NoiseMatrices *made = scaled->map->made;
    static const double NONE[N_LOADS] = {0.0};
    const double *load = made->load + scaled->n_loads * a, *noise_left = made->noise_left + N_LOADS * a;
    memset(products, 0, N_VALUES * sizeof *products);
    if (scaled->map->form.follows_pressure) {
        add_products(load, NONE, products);
    } else {
        add_products(noise_left, made->prior_left + N_LOADS * a, products);
    }
}

void scaled_prepare(Scaled *scaled) {
    const size_t n = scaled->map->n_gauges;
    const ScaledForm *form = &scaled->map->form;
    const NoiseMatrices *made = scaled->map->made;
    double *scale = scaled->residual;
    scaled->step.masked = NULL;
    dense_panels(n, n, made->whitening, 1, n, scaled->rows);
    dense_panels(n, n, made->whitening, n, 1, scaled->columns);
    for (size_t k = 0; k < dense_rows(n) * dense_columns(n); k++) {
        scaled->square[k] = scaled->columns[k] * scaled->columns[k];
    }
    dense_panels(N_LOADS, n, made->load, 1, scaled->n_loads, scaled->loads);
    for (size_t i = 0; i < n; i++) {
        const double *column = made->whitening + i * n;
        /* Columns of unit length keep the screen of residuals in float within its range: linear_outputs.c. */
        scaled->size[i] = sqrt(dot(n, column, column));
        scale[i] = 1.0 / scaled->size[i];
    }
    narrow_panels(n, n, made->whitening, n, 1, scale, scaled->screen);
    for (size_t a = 0; a < n; a++) {
        double products[N_VALUES];
        set_products(scaled, a, products);
        for (size_t k = 0; k < N_VALUES; k++) {
            scaled->squares[(k / ROWS) * ROWS * dense_columns(n) + a * ROWS + k % ROWS] = products[k];
        }
        if (scaled->of_gain != NULL) {
            /* u of the gain: the prior of the states counts gamma times, so their variance is 1 / gamma. */
            const double size = made->singular[a];
            scaled->of_gain[a] = 1.0 / (1.0 + size * size / scaled->map->regularisation);
        }
    }
    memcpy(scaled->own_mean, form->mean_strain, n * sizeof *scaled->own_mean);
    dense_times(0, n, n, scaled->rows, scaled->own_mean, scaled->mean);
    memset(scaled->residual, 0, n * sizeof *scaled->residual);
    current_errors_prepare(scaled);
}

/* u, the weights W of loads, and s^2 u of their covariance. The last two loops overwrite the free states, and all
   directions of form "absolute". */
EVERYWHERE void set_weights(const Scaled *scaled, ScaledStep *step) {
    const ScaledForm *form = &scaled->map->form;
    const NoiseMatrices *made = scaled->map->made;
    const double s = step->ratio;
    const size_t n = scaled->map->n_gauges;
    for (size_t a = 0; a < n; a++) {
        const double size = s * made->singular[a], unresolved = 1.0 / (1.0 + size * size);
        step->unresolved[a] = unresolved;
        step->weight[a] = s * size * unresolved;
        step->spread[a] = s * s * unresolved;
    }
    for (size_t a = 0; a < form->n_free; a++) {
        step->unresolved[a] = 0.0;
    }
    for (size_t a = 0; a < form->n_fixed; a++) {
        step->weight[a] = step->spread[a] = 1.0;
    }
}

/* Add B B' of lost_rows.c. In form "absolute" with a gain of its own lost_rows_products has this already. */
static void add_growth(ScaledStep *step) {
    for (size_t i = 0; i < N_LOADS; i++) {
        for (size_t j = 0; j <= i; j++) {
            const double more =
                dot(step->n_lost, step->growth + i * step->n_lost, step->growth + j * step->n_lost);
            step->base[i * N_LOADS + j] += more;
            step->base[j * N_LOADS + i] += i == j ? 0.0 : more;
        }
    }
}

/* The lost gauges, and V (m - d_0) without them; lost_rows_prepare puts in their prediction. */
static void set_lost(Scaled *scaled, ScaledStep *step) {
    const size_t n = scaled->map->n_gauges;
    step->n_lost = 0;
    if (step->masked->n_used == n) {
        step->of_mean = scaled->mean;
        return;
    }
    memcpy(scaled->own_mean, scaled->map->form.mean_strain, n * sizeof *scaled->own_mean);
    for (size_t i = 0; i < n; i++) {
        if (!step->masked->mask[i]) {
            scaled->own_mean[i] = 0.0;
            step->lost[step->n_lost++] = i;
        }
    }
    step->of_mean = scaled->mean_left;
    dense_times(scaled->wide, n, n, scaled->rows, scaled->own_mean, scaled->mean_left);
}

/* cov f and df/dq_inf, without errors at the current strain. */
EVERYWHERE void set_spread(Scaled *scaled, ScaledStep *step) {
    const size_t n = scaled->map->n_gauges;
    const ScaledForm *form = &scaled->map->form;
    const NoiseMatrices *made = scaled->map->made;
    const double s = step->ratio, nominal = scaled->map->dynamic_pressure;
    double of_mean[ROWS], squares[N_VALUES];
    for (size_t a = 0; a < n; a++) {
        step->scratch[1][a] = step->weight[a] * step->of_mean[a];
    }
    dense_times(scaled->wide, ROWS, n, scaled->loads, step->scratch[1], of_mean);
    dense_times(scaled->wide, N_VALUES, n, scaled->squares, step->spread, squares);
    for (size_t i = 0; form->follows_pressure && i < N_LOADS; i++) {
        step->per_pressure[i] = (form->load_of_mean[i] - of_mean[i]) / nominal;
    }
    if (step->n_lost > 0 && scaled->of_gain != NULL) {
        lost_rows_products(scaled, squares);
    }
    for (size_t i = 0, k = 0; i < N_LOADS; i++) {
        for (size_t j = i; j < N_LOADS; j++, k++) {
            step->base[i * N_LOADS + j] = step->base[j * N_LOADS + i] = squares[k];
        }
    }
    for (size_t k = 0; k < N_LOADS * N_LOADS; k++) {
        step->base[k] += s * s * made->unseen[k];
    }
    if (step->n_lost > 0 && scaled->of_gain == NULL) {
        add_growth(step);
    }
}

/* What follows from the gauges in use and the ratio, in two parts: the product with the residual comes between them, so
   that it need not wait for the divisions of the weights. */
EVERYWHERE void prepare_weights(Scaled *scaled, const MaskedMap *masked, double ratio) {
    ScaledStep *step = &scaled->step;
    step->masked = masked;
    step->number = masked->number;
    step->ratio = ratio;
    set_weights(scaled, step);
    set_lost(scaled, step);
}

EVERYWHERE void prepare_spread(Scaled *scaled) {
    ScaledStep *step = &scaled->step;
    if (step->n_lost > 0) {
        lost_rows_prepare(scaled);
    }
    set_spread(scaled, step);
    step->interval = current_interval(scaled, step->ratio);
    if (step->n_lost > 0) {
        step->bounded = current_errors_set_bound(scaled, step->interval, step->n_lost, step->bound);
        current_errors_take_lost(scaled);
    }
}

/* w = V r. Residuals of lost gauges are 0 here, whatever they read; lost_rows_condition predicts them. */
EVERYWHERE void set_residual(Scaled *scaled, ScaledStep *step, const double *strain) {
    const size_t n = scaled->map->n_gauges;
    const ScaledForm *form = &scaled->map->form;
    for (size_t i = 0; i < n; i++) {
        scaled->residual[i] = strain[i] - (form->fixed_strain[i] + step->ratio * form->mean_strain[i]);
    }
    for (size_t j = 0; j < step->n_lost; j++) {
        scaled->residual[step->lost[j]] = 0.0;
    }
    dense_times(scaled->wide, n, n, scaled->rows, scaled->residual, step->w);
}

/* f = f_0 + s f_mean + F W w. */
EVERYWHERE void set_loads(Scaled *scaled, ScaledStep *step) {
    const size_t n = scaled->map->n_gauges;
    const ScaledForm *form = &scaled->map->form;
    double loads[ROWS];
    for (size_t a = 0; a < n; a++) {
        step->scratch[0][a] = step->weight[a] * step->w[a];
    }
    dense_times(scaled->wide, ROWS, n, scaled->loads, step->scratch[0], loads);
    for (size_t i = 0; i < N_LOADS; i++) {
        step->loads[i] = form->fixed_load[i] + step->ratio * form->load_of_mean[i] + loads[i];
    }
}

/* The ratio r of expected chi-square to its degrees of freedom, r = 1 + s^2 tr(P D) / freedom. Limits rise as
   r (1 + level_slope (r - 1)): docs/explanation/alarm_levels.md. */
static void set_limit_ratio(Scaled *scaled, double trace) {
    ScaledStep *step = &scaled->step;
    const double s = step->ratio;
    const int freedom = scaled->map->degrees_of_freedom - (int)step->n_lost;
    step->limit_ratio = 1.0;
    if (scaled->map->form.has_errors && freedom > 0) {
        const double least = scaled->map->form.min_expected_ratio;
        step->limit_ratio = 1.0 + s * s * trace / (double)freedom;
        step->limit_ratio = step->limit_ratio > least ? step->limit_ratio : least;
        if (scaled->map->level_slope > 0.0) { /* an infinite ratio stays */
            step->limit_ratio *= 1.0 + scaled->map->level_slope * (step->limit_ratio - 1.0);
        }
    }
}

/* Errors in proportion to strain at the current one: s^2 G D G' to the covariance, and tr(P D) to the limits; `value` (16) are
   both, NULL without such errors. */
void set_current_errors(Scaled *scaled, const double *value) {
    ScaledStep *step = &scaled->step;
    const double square = step->ratio * step->ratio;
    memcpy(step->covariance, step->base, sizeof step->covariance);
    for (size_t i = 0, v = 0; value != NULL && i < N_LOADS; i++) {
        for (size_t j = i; j < N_LOADS; j++, v++) {
            step->covariance[i * N_LOADS + j] = step->covariance[j * N_LOADS + i] =
                step->base[i * N_LOADS + j] + square * value[v];
        }
    }
    set_limit_ratio(scaled, value != NULL ? value[TRACE] : 0.0);
}

/* One sample. The order hides latencies: the product V r runs while the divisions of u are under way. All of it
   except what lost gauges need is inlined here, so that the loops over directions are compiled for AVX2 too. */
EVERYWHERE void condition(Scaled *scaled, const MaskedMap *masked, const double *strain) {
    ScaledStep *step = &scaled->step;
    const size_t n = scaled->map->n_gauges;
    const double ratio = scaled->map->form.follows_pressure ? step->pressure / scaled->map->dynamic_pressure : 1.0;
    /* masked->number distinguishes a set of gauges from an older one in the same cache entry. */
    const int is_other = step->masked != masked || step->number != masked->number || step->ratio != ratio;
    if (is_other) {
        prepare_weights(scaled, masked, ratio);
    }
    set_residual(scaled, step, strain);
    if (is_other) {
        prepare_spread(scaled);
    }
    if (step->n_lost > 0) {
        lost_rows_condition(scaled);
    } else {
        for (size_t a = 0; a < n; a++) {
            step->x[a] = step->unresolved[a] * step->w[a];
        }
        step->chi_square = dot(n, step->x, step->w);
    }
    set_loads(scaled, step);
    set_current_errors(scaled, scaled->map->form.has_errors ? current_errors_values(scaled) : NULL);
}

FOR_AVX2(condition, (Scaled *scaled, const MaskedMap *masked, const double *strain), (scaled, masked, strain))

void scaled_condition(Scaled *scaled, const MaskedMap *masked, double pressure, const double *strain) {
    scaled->step.pressure = pressure;
    if (scaled->map->has_low_rank) {
        low_rank_condition(scaled, masked, strain);
        return;
    }
    CHOSEN(scaled->wide, condition)(scaled, masked, strain);
}

/* z_i = (P r)_i / sqrt(P_ii). A P_ii of the size of rounding means that no other gauge checks this one: its z is 0. */
void scaled_standardised_residuals(Scaled *scaled, double *z) {
    const size_t n = scaled->map->n_gauges;
    ScaledStep *step = &scaled->step;
    const MaskedMap *m = step->masked;
    if (scaled->map->has_low_rank) {
        low_rank_residuals(scaled, z);
        return;
    }
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
        const int checked = precision > scaled->map->made->min_precision[gauge];
        z[gauge] = checked ? slope[gauge] / sqrt(precision) : 0.0;
    }
}

void scaled_other_load(const Scaled *scaled, size_t k, double *value, double *variance, double *per_pressure) {
    const NoiseMatrices *made = scaled->map->made;
    const OtherLoads *other_loads = scaled->other_loads;
    const ScaledStep *step = &scaled->step;
    const size_t n = scaled->map->n_gauges, j = k - N_LOADS;
    const double s = step->ratio, *growth = step->growth + k * step->n_lost;
    double sum = 0.0, of_mean = 0.0, spread = 0.0;
    for (size_t a = 0; a < n; a++) {
        const double load = made->load[a * scaled->n_loads + k], weighted = step->weight[a] * load;
        sum += weighted * step->w[a];
        of_mean += weighted * step->of_mean[a];
        spread += step->spread[a] * (load * load);
    }
    *value = other_loads->map.fixed_load[j] + s * other_loads->map.load_of_mean[j] + sum;
    *per_pressure = (other_loads->map.load_of_mean[j] - of_mean) / scaled->map->dynamic_pressure;
    *variance = spread + s * s * made->other_unseen[j] + dot(step->n_lost, growth, growth);
    if (scaled->map->form.has_errors) {
        *variance += s * s * current_errors_of_other(scaled, j);
    }
    *variance = *variance > 0.0 ? *variance : 0.0;
}

/* F_k W V - B_k Y'. */
double scaled_gain(Scaled *scaled, size_t k, double *gain) {
    const ScaledStep *step = &scaled->step;
    const size_t n = scaled->map->n_gauges;
    if (scaled->map->has_low_rank) {
        return low_rank_gain(scaled, k, gain);
    }
    double value, variance, per_pressure = 0.0, *weighted = step->scratch[0];
    if (k < N_LOADS) {
        per_pressure = step->per_pressure[k];
    } else {
        scaled_other_load(scaled, k, &value, &variance, &per_pressure);
    }
    for (size_t a = 0; a < n; a++) {
        weighted[a] = step->weight[a] * scaled->map->made->load[a * scaled->n_loads + k];
    }
    dense_times(scaled->wide, n, n, scaled->columns, weighted, gain);
    lost_rows_take(scaled, k, gain);
    return per_pressure;
}
