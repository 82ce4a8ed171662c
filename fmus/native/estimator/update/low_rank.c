/* The update for many gauges whose errors are a few columns and one error of each gauge: diagonal plus low rank.

   In the letters of low_rank_columns.c and low_rank_points.c

       x = C H' W r,      e = r - H x
       chi-square = e' W e + |prior x / size|^2
       f = f_0 + s f_mean + F x + s^2 X_t' W e
       P_ii = w_i - w_i^2 h_i' C h_i,      z_i = w_i e_i / sqrt(P_ii)

   A step costs two readings of [H, X_t, m]. A lost gauge is a row of weight 0: what a step costs does not depend on how
   many there are. P_ii is good to the round-off of w_i: the form is for gauges that the columns do not determine, as where
   there are many more gauges than columns.

   tests/estimator/reference/test_low_rank.py compares it with the dense update for the same gauges. */

#include "low_rank.h"

#include <math.h>
#include <string.h>

/* Everything that follows from the gauges in use and the ratio. */
static void prepare_step(Scaled *scaled, const MaskedMap *masked, double s) {
    const Map *map = scaled->map;
    LowRank *low = &scaled->low;
    ScaledStep *step = &scaled->step;
    const size_t order = low->order;
    low_rank_at(scaled, masked, s);
    low_rank_between(scaled, triangle_column(order), low->at->covariance, low->covariance);
    low_rank_between(scaled, (N_LOADS + 1) * order, low->at->column, low->column);
    low_rank_between(scaled, N_LOW_VALUES, low->at->value, low->value);
    low_rank_weights(scaled, masked->mask, s, low->weight);
    for (size_t i = 0, k = 0; i < N_LOADS; i++) {
        for (size_t j = i; j < N_LOADS; j++, k++) {
            step->base[i * N_LOADS + j] = step->base[j * N_LOADS + i] = low->value[k];
        }
        step->per_pressure[i] = (map->form.load_of_mean[i] - low->value[15 + i]) / map->dynamic_pressure;
    }
    step->masked = masked;
    step->number = masked->number;
    step->ratio = s;
    step->n_lost = map->n_gauges - masked->n_used;
    low->has_precision = 0;
}

/* [H, X_t, m]' W r, four gauges at a time. */
EVERYWHERE void along_rows(size_t n, size_t width, const double *restrict row, const double *restrict x, double *restrict out) {
    memset(out, 0, width * sizeof *out);
    size_t g = 0;
    for (; g + 4 <= n; g += 4) {
        const double *a = row + g * width, *b = a + width, *c = b + width, *d = c + width;
        for (size_t k = 0; k < width; k++) {
            out[k] += (x[g] * a[k] + x[g + 1] * b[k]) + (x[g + 2] * c[k] + x[g + 3] * d[k]);
        }
    }
    for (; g < n; g++) {
        add_times(width, x[g], row + g * width, out);
    }
}

#if defined(__GNUC__)
typedef double Lanes __attribute__((vector_size(LANES * sizeof(double)), aligned(sizeof(double)), may_alias));
#define LANES_AT(x) (*(const Lanes *)(x))
#endif

/* e -= H x. Four gauges at a time: the sum of one waits for each of its additions, four do not wait for each other. Each
   adds up as sum_of_products does. */
EVERYWHERE void subtract_response(size_t n, size_t width, size_t order, const double *restrict row, const double *restrict x,
                                  double *restrict error) {
    size_t g = 0;
#if defined(__GNUC__)
    for (; g + 4 <= n; g += 4) {
        const double *a = row + g * width, *b = a + width, *c = b + width, *d = c + width;
        Lanes of_a = {0.0}, of_b = {0.0}, of_c = {0.0}, of_d = {0.0};
        size_t k = 0;
        for (; k + LANES <= order; k += LANES) {
            const Lanes factor = LANES_AT(x + k);
            of_a += LANES_AT(a + k) * factor;
            of_b += LANES_AT(b + k) * factor;
            of_c += LANES_AT(c + k) * factor;
            of_d += LANES_AT(d + k) * factor;
        }
        double sum[] = {(of_a[0] + of_a[1]) + (of_a[2] + of_a[3]), (of_b[0] + of_b[1]) + (of_b[2] + of_b[3]),
                        (of_c[0] + of_c[1]) + (of_c[2] + of_c[3]), (of_d[0] + of_d[1]) + (of_d[2] + of_d[3])};
        for (; k < order; k++) {
            sum[0] += a[k] * x[k];
            sum[1] += b[k] * x[k];
            sum[2] += c[k] * x[k];
            sum[3] += d[k] * x[k];
        }
        for (size_t r = 0; r < 4; r++) {
            error[g + r] -= sum[r];
        }
    }
#endif
    for (; g < n; g++) {
        error[g] -= sum_of_products(order, row + g * width, x);
    }
}

/* r, then x and e. */
EVERYWHERE void solve_sample(Scaled *scaled, const double *strain) {
    const ScaledForm *form = &scaled->map->form;
    LowRank *low = &scaled->low;
    const size_t n = scaled->map->n_gauges, order = low->order, width = low->width;
    for (size_t i = 0; i < n; i++) {
        const double residual = strain[i] - (form->fixed_strain[i] + scaled->step.ratio * form->mean_strain[i]);
        low->error[i] = low->weight[i] > 0.0 ? residual : 0.0;
        low->weighted[i] = low->weight[i] * low->error[i];
    }
    along_rows(n, width, low->row, low->weighted, low->of_residual);
    times_covariance(order, low->covariance, low->of_residual, low->x);
    subtract_response(n, width, order, low->row, low->x, low->error);
    for (size_t i = 0; i < n; i++) {
        low->weighted[i] = low->weight[i] * low->error[i];
    }
}

FOR_AVX2(solve_sample, (Scaled *scaled, const double *strain), (scaled, strain))

/* Errors at the current strain. */
static void add_errors(Scaled *scaled) {
    double product[N_PAIRS], value[N_VALUES];
    if (!scaled->map->form.has_errors) {
        set_current_errors(scaled, NULL);
        return;
    }
    set_products_of_coefficients(scaled, product);
    for (size_t v = 0; v < N_VALUES; v++) {
        value[v] = dot(N_PAIRS, scaled->low.value + N_BASE + v * N_PAIRS, product);
    }
    set_current_errors(scaled, value);
}

void low_rank_condition(Scaled *scaled, const MaskedMap *masked, const double *strain) {
    const ScaledForm *form = &scaled->map->form;
    LowRank *low = &scaled->low;
    ScaledStep *step = &scaled->step;
    const size_t order = low->order;
    const double s = step->pressure / scaled->map->dynamic_pressure;
    if (step->masked != masked || step->number != masked->number || step->ratio != s) {
        prepare_step(scaled, masked, s);
    }
    CHOSEN(scaled->wide, solve_sample)(scaled, strain);
    step->chi_square = dot(scaled->map->n_gauges, low->weighted, low->error);
    for (size_t c = 0; c < order; c++) {
        const double amplitude = low->prior[c] * low->x[c] / size_at(low, s, c);
        step->chi_square += amplitude * amplitude;
    }
    for (size_t i = 0; i < N_LOADS; i++) { /* X_t' W e = X_t' W r - g' x */
        const double rest = low->of_residual[order + i] - dot(order, low->column + i * order, low->x);
        const double of_mean = form->fixed_load[i] + s * form->load_of_mean[i];
        step->loads[i] = of_mean + (dot(order, low->load + i * order, low->x) + s * s * rest);
    }
    add_errors(scaled);
}

/* A P_ii of the size of rounding means that no other gauge checks this one. */
static int is_checked(const Scaled *scaled, size_t gauge, double precision) {
    const LowRank *low = &scaled->low;
    return precision > scaled->map->min_information / (low->noise[gauge] + low->common);
}

void low_rank_residuals(Scaled *scaled, double *z) {
    LowRank *low = &scaled->low;
    const MaskedMap *m = scaled->step.masked;
    if (!low->has_precision) {
        low_rank_between(scaled, scaled->map->n_gauges, low->at->precision, low->precision);
        low->has_precision = 1;
    }
    for (size_t k = 0; k < m->n_used; k++) {
        const size_t i = m->used[k];
        z[i] = is_checked(scaled, i, low->precision[i]) ? low->weighted[i] / sqrt(low->precision[i]) : 0.0;
    }
}

double low_rank_gain(Scaled *scaled, size_t k, double *gain) {
    LowRank *low = &scaled->low;
    const size_t order = low->order;
    const double square = scaled->step.ratio * scaled->step.ratio;
    for (size_t c = 0; c < order; c++) {
        low->of_residual[c] = low->load[k * order + c] - square * low->column[k * order + c];
    }
    times_covariance(order, low->covariance, low->of_residual, low->x);
    for (size_t g = 0; g < scaled->map->n_gauges; g++) {
        const double *row = low->row + g * low->width;
        gain[g] = low->weight[g] * (dot(order, row, low->x) + square * row[order + k]);
    }
    return scaled->step.per_pressure[k];
}

/* L of the covariance of the free states, the last rows of C, filled up with the unit matrix to whole lanes. */
static void set_free_root(const Scaled *scaled, const double *covariance, double *root) {
    const size_t n_free = scaled->map->form.n_free, order = scaled->low.order, n = in_lanes(n_free);
    covariance += triangle_column(order) - triangle_column(n_free);
    memset(root, 0, n * n * sizeof *root);
    for (size_t i = 0; i < n; i++) {
        root[i * n + i] = 1.0;
    }
    for (size_t i = 0; i < n_free; covariance += n_free - i, i++) {
        memcpy(root + i * n + i, covariance, (n_free - i) * sizeof *root);
    }
    cholesky(scaled->wide, n, root);
}

/* The roots R of the gauges in use, R_0 of all gauges: the square of the smallest singular value of R^-1 R_0. */
double low_rank_information(Scaled *scaled, const MaskedMap *masked) {
    LowRank *low = &scaled->low;
    const size_t n = in_lanes(scaled->map->form.n_free), n_lost = scaled->map->n_gauges - masked->n_used;
    if (!low->all_identify || !low_rank_nominal_covariance(scaled, masked->mask, n_lost, low->of_set)) {
        return 0.0;
    }
    set_free_root(scaled, low->of_all, low->ratio);
    set_free_root(scaled, low->of_set, low->free);
    solve_lower(scaled->wide, n, low->free, n, low->ratio);
    const double smallest = smallest_singular_value(n, low->ratio, low->free);
    return smallest * smallest;
}

int low_rank_correlated(const Scaled *scaled, size_t i, size_t j) {
    const LowRank *low = &scaled->low;
    const size_t order = low->order;
    const double product = dot(order, low->nominal_along + i * order, low->nominal_along + j * order);
    const double covariance = low->nominal_weight[i] * low->nominal_weight[j] * product;
    const double squares = low->nominal_precision[i] * low->nominal_precision[j];
    const double limit = scaled->map->ambiguous_correlation;
    return is_checked(scaled, i, low->nominal_precision[i]) && is_checked(scaled, j, low->nominal_precision[j])
        && covariance * covariance >= limit * limit * squares;
}
