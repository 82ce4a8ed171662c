/* Derivatives of rolling moment and section loads of the linear estimator: further_loads.c has the formulas, and
   scaled_derivative.c those of the five loads. */

#include <string.h>

#include "../estimator.h"
#include "../numerics/dual.h"
#include "../numerics/triangles.h"
#include "../step_parts.h"
#include "scaled_form.h"

/* What all loads have in common: change of the pressure ratio, and of the products of coefficients. */
typedef struct {
    double ds, product[N_PAIRS];
} CommonChange;

static void set_products(const Estimator *e, const ScaledChange *change, double *product) {
    const ScaledStep *step = &e->scaled.step;
    double c[1 + N_LOADS] = {1.0}, d_c[1 + N_LOADS] = {0.0}, scale[N_LOADS];
    coefficient_scales(e->flow.pressure, e->map.reference_area, e->map.reference_length, scale);
    for (size_t i = 0; i < N_LOADS; i++) {
        c[1 + i] = scale[i] * step->loads[i];
        d_c[1 + i] = scale[i] * change->loads[i] - c[1 + i] * change->pressure / e->flow.pressure;
    }
    for (size_t a = 0, pair = 0; a <= N_LOADS; a++) {
        for (size_t b = a; b <= N_LOADS; b++) {
            product[pair++] = d_c[a] * c[b] + c[a] * d_c[b];
        }
    }
}

/* Change of what errors in proportion to strain add to the variance of load j. */
static double derive_proportional(Estimator *e, size_t j, const CommonChange *common) {
    const ScaledStep *step = &e->scaled.step;
    const double *low = further_level_products(e, step->levels[0]), *high = further_level_products(e, step->levels[1]);
    const size_t m = e->further.map.n_loads;
    double of_low = 0.0, of_high = 0.0, d_low = 0.0, d_high = 0.0;
    for (size_t pair = 0; pair < N_PAIRS; pair++) {
        of_low += step->product[pair] * low[pair * m + j];
        of_high += step->product[pair] * high[pair * m + j];
        d_low += common->product[pair] * low[pair * m + j];
        d_high += common->product[pair] * high[pair * m + j];
    }
    const double s = step->ratio, excess = (1.0 - step->part) * of_low + step->part * of_high;
    const double d_excess = common->ds / step->distance * (of_high - of_low) + (1.0 - step->part) * d_low
                          + step->part * d_high;
    return 2.0 * s * common->ds * excess + s * s * d_excess;
}

/* z = V_R' T^-1 X of load j, what lost gauges add to its variance being |X|^2. */
static void set_growth(Estimator *e, size_t j, double *z) {
    const ScaledStep *step = &e->scaled.step;
    const size_t n = e->map.n_gauges, m = e->further.map.n_loads;
    double *y = e->further.scratch + N_PAIRS * m; /* (n_lost) X of further_growth */
    further_growth(e, j);
    solve_triangle(n, step->n_lost, step->matrix, y);
    memset(z, 0, n * sizeof *z);
    for (size_t lost = 0; lost < step->n_lost; lost++) {
        for (size_t a = 0; a < n; a++) {
            z[a] += y[lost] * e->map.form.whitening[step->lost[lost] * n + a];
        }
    }
}

/* Changes of load j, its variance and its derivative by q_inf. */
static void change_load(Estimator *e, size_t j, const CommonChange *common, double *d_value, double *d_variance,
                        double *d_per_pressure) {
    const ScaledStep *step = &e->scaled.step;
    const ScaledForm *form = &e->map.form;
    const size_t n = e->map.n_gauges, m = e->further.map.n_loads;
    const double *d_w = step->scratch[0], *d_mean = step->scratch[1];
    const double s = step->ratio, ds = common->ds;
    double *z = e->scaled.work[0], sum = 0.0, of_mean = 0.0, spread = 0.0;
    if (step->n_lost > 0) {
        set_growth(e, j, z);
    }
    for (size_t a = 0; a < n; a++) {
        const double load = e->further.load[a * m + j], u = step->unresolved[a], weight = step->weight[a];
        const double faster = a < form->n_free ? 0.0 : 2.0 * s * u * u * ds; /* of s^2 u */
        const double d_weight = faster * form->singular[a];
        sum += load * (d_weight * step->w[a] + weight * d_w[a]);
        of_mean += load * (d_weight * step->of_mean[a] + weight * d_mean[a]);
        spread += faster * load * load;
        if (step->n_lost > 0) {
            spread += 2.0 * d_weight * load * z[a] - scaled_unresolved_change(e, a, ds) * z[a] * z[a];
        }
    }
    *d_value = e->further.map.of_mean[j] * ds + sum;
    *d_per_pressure = -of_mean / e->map.dynamic_pressure;
    *d_variance = spread + 2.0 * s * ds * e->further.unseen[j]
                + (form->has_errors ? derive_proportional(e, j, common) : 0.0);
}

void further_derivative(Estimator *e, const double *d_scalar, const ScaledChange *change, double *d_further) {
    const size_t m = e->further.map.n_loads;
    const double *scalar = e->input + e->map.n_gauges;
    const Dual pressure = dual(e->flow.pressure, change->pressure);
    const Dual deviation = dual(e->flow.deviation, derive_deviation(e, d_scalar)), one = {1.0, 0.0};
    const Dual area = dual(scalar[REFERENCE_AREA], d_scalar[REFERENCE_AREA]);
    const Dual length = dual(scalar[REFERENCE_LENGTH], d_scalar[REFERENCE_LENGTH]);
    CommonChange common = {.ds = change->ds};
    set_products(e, change, common.product);
    for (size_t j = 0; j < m; j++) {
        Dual value, variance, per;
        further_load(e, j, &value.value, &variance.value, &per.value);
        change_load(e, j, &common, &value.change, &variance.change, &per.change);
        variance.change = variance.value > 0.0 ? variance.change : 0.0;
        const Dual own = e->further.map.is_moment[j] > 0.0 ? dual_product(area, length) : area;
        const Dual scale = dual_ratio(one, dual_product(pressure, own));
        const Dual of_pressure = dual_product(per, deviation), coefficient = dual_product(scale, value);
        const Dual of_both = dual_sum(1.0, dual_product(scale, of_pressure), -1.0,
                                      dual_product(coefficient, dual_ratio(deviation, pressure)));
        const Dual total = dual_sum(1.0, variance, 1.0, dual_product(of_pressure, of_pressure));
        const Dual scaled = dual_product(dual_product(scale, scale), variance);
        const Dual of_coefficient = dual_sum(1.0, scaled, 1.0, dual_product(of_both, of_both));
        d_further[FURTHER_LOADS * m + j] = value.change;
        d_further[FURTHER_LOADS_STD * m + j] = dual_root(total).change;
        d_further[FURTHER_COEFFICIENTS * m + j] = coefficient.change;
        d_further[FURTHER_COEFFICIENTS_STD * m + j] = dual_root(of_coefficient).change;
    }
}
