/* Errors in proportion to strain at the current strain: what they add to covariance and expected chi-square.

   An error t has the strain s E_t c for one standard deviation, where c = [1, C_A, C_N, C_Y, M_P, M_Y]: own errors
   of each gauge are independent (D_t), common ones move all gauges (E_t). The weights of the map include their mean
   over the snapshots, mean(c c'). With the estimated c the rows have the additional covariance s^2 D
   (eq:proportional),

       D = sum over a, b of (c_a c_b - mean(c_a c_b)) H_ab,   H_ab = diag_i(sum_t D_tai D_tbi) + sum_t E_ta E_tb',

   which the gain G (loads, n) and the precision P (n, n) of the step turn into

       cov f grows by s^2 G D G',       expected chi-square by s^2 tr(P D).

   D is linear in the 21 products c_a c_b, a <= b; pairs a < b count twice. So each value v (15 entries of G D G',
   the trace, then one variance for each other load) is a sum over pairs p,

       v = sum_p k_vp(s) (c_a c_b - mean)_p.

   k_vp depends on s alone, by G(s) and P(s), and is smooth. In an interval of s, a factor 2^(1/16) wide, a
   polynomial in t = (s - middle) / half through N_NODES = 6 Chebyshev points reproduces it to 1e-10 of a variance.
   `factor` (values, 6 * 21) has k_vp at these points, `parts` (6 * 21) is (c_a c_b - mean)_p times Lagrange's polynomial of
   each: v = factor parts. An interval is filled when s first enters it; 16 are kept.

   Lost gauges are taken out exactly, with P = P_all - Y Y' and G = G_all - B Y' of lost_rows.c: G D G' by this gain,

       tr(P D) = tr(P D)_all - tr(Y' D Y).

   docs/explanation/sigma.md, "Errors in proportion to strain", derives eq:proportional; excess_covariance in
   strainfmu/estimator/reference/linear.py is D in numpy. */

#include "update.h"

#include "../../core/elementary.h"

#include <math.h>
#include <string.h>

#define N_FACTORS (N_NODES * N_PAIRS)

/* Half of an interval of ln s: ln 2 / 32. */
#define HALF_WIDTH 0x1.62e42fefa39efp-6

double ratio_interval(double ratio, double half_width, double *t) {
    const double place = logarithm(ratio) / (2.0 * half_width), whole = (double)(int)place;
    const double number = whole > place ? whole - 1.0 : whole;
    *t = 2.0 * (place - number) - 1.0;
    return number;
}

double ratio_at(double number, double half_width, double t) {
    return exponential((2.0 * number + 1.0 + t) * half_width);
}

static size_t n_values(const Scaled *scaled) {
    return N_VALUES + scaled->n_loads - N_LOADS;
}

void current_errors_arrays(Scaled *scaled, Room *room) {
    CurrentErrors *errors = &scaled->errors;
    const size_t n = scaled->map->n_gauges, whole = dense_rows(n), values = n_values(scaled);
    const size_t loads = scaled->n_loads, common = 6 * scaled->map->form.n_terms;
    errors->of_gauge = taken(room, dense_rows(N_PAIRS) * dense_columns(n));
    errors->rows = taken(room, dense_rows(common) * dense_columns(n));
    errors->load_along = taken(room, loads * dense_rows(common));
    errors->lost_along = taken(room, n * dense_rows(common));
    errors->sized = taken(room, dense_rows(common));
    errors->common = taken(room, common * whole);
    TAKE(room, loads * whole, &errors->weighted, &errors->gain);
    TAKE(room, whole, &errors->unresolved, &errors->precision, &errors->product);
    errors->products = taken(room, dense_rows(N_PAIRS));
    errors->parts = taken(room, dense_columns(N_FACTORS));
    errors->value = taken(room, dense_rows(N_VALUES));
    errors->own = taken(room, whole);
    for (size_t k = 0; k < CACHED_INTERVALS; k++) {
        errors->interval[k].factor = taken(room, dense_rows(values) * dense_columns(N_FACTORS));
    }
    for (size_t k = 0; k < CACHED_INTERVALS; k++) {
        TAKE(room, n, &errors->interval[k].least_precision, &errors->interval[k].margin, &errors->interval[k].bound);
    }
    errors->at_nodes = taken(room, values * N_FACTORS);
    errors->common_load = taken(room, 6 * loads);
    errors->node = taken(room, N_PAIRS * values);
    errors->sum = taken(room, dense_rows(N_PAIRS));
}

void current_errors_prepare(Scaled *scaled) {
    const size_t n = scaled->map->n_gauges, whole = dense_rows(n);
    const ScaledForm *form = &scaled->map->form;
    CurrentErrors *errors = &scaled->errors;
    errors->next = 0;
    for (size_t k = 0; k < CACHED_INTERVALS; k++) {
        errors->interval[k].below = NAN;
    }
    if (!form->has_errors) {
        return;
    }
    dense_panels(N_PAIRS, n, form->of_gauge, n, 1, errors->of_gauge);
    dense_panels(6 * form->n_terms, n, form->common, n, 1, errors->rows);
    for (size_t t = 0; t < 6 * form->n_terms; t++) {
        memcpy(errors->product, form->common + t * n, n * sizeof *errors->product);
        /* V E_ta: the common errors in directions, in which G and P are diagonal. */
        dense_times(scaled->wide, n, n, scaled->rows, errors->product, errors->common + t * whole);
    }
}

/* u and P_ii = sum over a of u_a V_ai^2 of all gauges at a ratio; scaled_form.c has the same of the step. */
static void set_precision(Scaled *scaled, double ratio) {
    const size_t n = scaled->map->n_gauges;
    const ScaledForm *form = &scaled->map->form;
    const NoiseMatrices *made = scaled->map->made;
    CurrentErrors *errors = &scaled->errors;
    for (size_t a = 0; a < n; a++) {
        const double size = ratio * made->singular[a];
        errors->unresolved[a] = a < form->n_free ? 0.0 : 1.0 / (1.0 + size * size);
    }
    dense_times(scaled->wide, n, n, scaled->square, errors->unresolved, errors->precision);
}

/* W F and the gain G = F W V of all loads at the ratio of set_precision; W = s^2 S u, 1 for free states. */
static void set_gains(Scaled *scaled, double ratio) {
    const size_t n = scaled->map->n_gauges, whole = dense_rows(n);
    const ScaledForm *form = &scaled->map->form;
    const NoiseMatrices *made = scaled->map->made;
    CurrentErrors *errors = &scaled->errors;
    for (size_t k = 0; k < scaled->n_loads; k++) {
        double *weighted = errors->weighted + k * whole;
        for (size_t a = 0; a < n; a++) {
            const double weight = ratio * (ratio * made->singular[a]) * errors->unresolved[a];
            weighted[a] = (a < form->n_free ? 1.0 : weight) * made->load[a * scaled->n_loads + k];
        }
    }
    dense_times_many(scaled->wide, n, n, scaled->columns, scaled->n_loads, errors->weighted, whole, errors->gain, whole);
}

/* k_vp of the gauges' own errors: sum over gauges of (sum_t D_tai D_tbi) times errors->product, which is G_ig G_jg
   of a covariance and P_gg of the trace. of_gauge counts a pair a < b twice already. */
static void add_own(Scaled *scaled, size_t v) {
    CurrentErrors *errors = &scaled->errors;
    dense_times(scaled->wide, N_PAIRS, scaled->map->n_gauges, errors->of_gauge, errors->product, errors->sum);
    for (size_t pair = 0; pair < N_PAIRS; pair++) {
        errors->node[v * N_PAIRS + pair] += errors->sum[pair];
    }
}

static void add_all_own(Scaled *scaled) {
    const size_t n = scaled->map->n_gauges, whole = dense_rows(n);
    CurrentErrors *errors = &scaled->errors;
    size_t v = 0;
    for (size_t i = 0; i < N_LOADS; i++) {
        for (size_t j = i; j < N_LOADS; j++, v++) {
            for (size_t g = 0; g < n; g++) {
                errors->product[g] = errors->gain[i * whole + g] * errors->gain[j * whole + g];
            }
            add_own(scaled, v);
        }
    }
    memcpy(errors->product, errors->precision, n * sizeof *errors->product);
    add_own(scaled, TRACE);
    for (size_t k = N_LOADS; k < scaled->n_loads; k++) {
        const double *gain = errors->gain + k * whole;
        for (size_t g = 0; g < n; g++) {
            errors->product[g] = gain[g] * gain[g];
        }
        add_own(scaled, N_VALUES + k - N_LOADS);
    }
}

void add_common_error(size_t loads, const double *load, const double *square, double *value) {
    for (size_t a = 0, pair = 0; a < 6; a++) {
        for (size_t b = a; b < 6; b++, pair++) {
            const double twice = a == b ? 1.0 : 2.0;
            const double *first = load + a * loads, *second = load + b * loads;
            double *of_pair = value + pair;
            for (size_t i = 0; i < N_LOADS; i++) {
                for (size_t j = i; j < N_LOADS; j++, of_pair += N_PAIRS) {
                    *of_pair += 0.5 * twice * (first[i] * second[j] + second[i] * first[j]);
                }
            }
            *of_pair += twice * square[6 * a + b];
            for (size_t k = N_LOADS; k < loads; k++) {
                of_pair += N_PAIRS;
                *of_pair += twice * (first[k] * second[k]);
            }
        }
    }
}

/* One common error, of which `shown` (6, whole) is V E_a: in directions G and P are diagonal. */
static void add_common(Scaled *scaled, const double *shown) {
    const size_t n = scaled->map->n_gauges, whole = dense_rows(n);
    CurrentErrors *errors = &scaled->errors;
    const size_t loads = scaled->n_loads;
    double square[6 * 6];
    for (size_t a = 0; a < 6; a++) {
        for (size_t k = 0; k < loads; k++) {
            errors->common_load[a * loads + k] = dot(n, errors->weighted + k * whole, shown + a * whole);
        }
        for (size_t g = 0; g < n; g++) {
            errors->product[g] = errors->unresolved[g] * shown[a * whole + g];
        }
        for (size_t b = a; b < 6; b++) {
            square[6 * a + b] = dot(n, errors->product, shown + b * whole);
        }
    }
    add_common_error(loads, errors->common_load, square, errors->node);
}

/* Chebyshev's points of [-1, 1], cos((2 k + 1) pi / 12), and their weights for lagrange(). */
static const double POINT[N_NODES] = {0x1.ee8dd4748bf15p-1,  0x1.6a09e667f3bcdp-1,  0x1.0907dc1930690p-2,
                                      -0x1.0907dc1930690p-2, -0x1.6a09e667f3bcdp-1, -0x1.ee8dd4748bf15p-1};
static const double WEIGHT[N_NODES] = {0x1.615fd02195e16p+0,  -0x1.e2b7dddfefa66p+1, 0x1.49b3e2f85d4b9p+2,
                                       -0x1.49b3e2f85d4b9p+2, 0x1.e2b7dddfefa66p+1,  -0x1.615fd02195e16p+0};

/* k_vp at all points of an interval. */
static void set_factors(Scaled *scaled, Interval *interval) {
    CurrentErrors *errors = &scaled->errors;
    const size_t values = n_values(scaled);
    const double middle = 0.5 * (interval->below + interval->above), half = 0.5 * (interval->above - interval->below);
    for (size_t j = 0; j < N_NODES; j++) {
        const double ratio = middle + half * POINT[j];
        memset(errors->node, 0, N_PAIRS * values * sizeof *errors->node);
        set_precision(scaled, ratio);
        set_gains(scaled, ratio);
        add_all_own(scaled);
        for (size_t term = 0; term < scaled->map->form.n_terms; term++) {
            add_common(scaled, errors->common + 6 * term * dense_rows(scaled->map->n_gauges));
        }
        for (size_t v = 0; v < values; v++) {
            memcpy(errors->at_nodes + v * N_FACTORS + j * N_PAIRS, errors->node + v * N_PAIRS, N_PAIRS * sizeof *errors->node);
        }
    }
    dense_panels(values, N_FACTORS, errors->at_nodes, N_FACTORS, 1, interval->factor);
}

/* P_ii falls with s, so that the upper end of the interval bounds it from below; lost gauges take sum Y^2 from it. A
   gauge is open where the bound does not show on which side of round-off its P_ii lies. */
int current_errors_set_bound(const Scaled *scaled, const Interval *interval, size_t n_lost, double *restrict bound) {
    const size_t n = scaled->map->n_gauges, whole = dense_rows(n);
    const double *restrict round_off = scaled->map->made->min_precision;
    int known = 1;
    for (size_t i = 0; i < n; i++) {
        const double size = scaled->size[i], largest = interval->margin[i] * size;
        double lost = 0.0;
        for (size_t j = 0; j < n_lost; j++) {
            lost += scaled->step.y[j * whole + i] * scaled->step.y[j * whole + i];
        }
        const double least = interval->least_precision[i] - lost;
        const int checked = least > 2.0 * round_off[i], in_use = n_lost == 0 || scaled->step.masked->mask[i];
        bound[i] = checked && in_use ? size * size / least : 0.0;
        known &= checked || !in_use || largest * largest - lost < 0.5 * round_off[i];
    }
    return known;
}

/* u falls with s, and P_ii with it: the upper end has the smallest P_ii, the lower end the largest. */
static void set_bounds(Scaled *scaled, Interval *interval) {
    CurrentErrors *errors = &scaled->errors;
    set_precision(scaled, interval->above);
    memcpy(interval->least_precision, errors->precision, scaled->map->n_gauges * sizeof *errors->precision);
    set_precision(scaled, interval->below);
    for (size_t i = 0; i < scaled->map->n_gauges; i++) {
        interval->margin[i] = sqrt(errors->precision[i]) / scaled->size[i];
    }
    interval->bounded = current_errors_set_bound(scaled, interval, 0, interval->bound);
}

/* The oldest gives way. Ends are the same numbers for both intervals that they belong to, so that one holds a ratio. */
const Interval *current_interval(Scaled *scaled, double ratio) {
    CurrentErrors *errors = &scaled->errors;
    for (size_t k = 0; k < CACHED_INTERVALS; k++) {
        if (errors->interval[k].below <= ratio && ratio < errors->interval[k].above) {
            return &errors->interval[k];
        }
    }
    Interval *interval = &errors->interval[errors->next];
    errors->next = (errors->next + 1) % CACHED_INTERVALS;
    double place, number = ratio_interval(ratio, HALF_WIDTH, &place);
    number += ratio < ratio_at(number, HALF_WIDTH, -1.0) ? -1.0 : ratio < ratio_at(number, HALF_WIDTH, 1.0) ? 0.0 : 1.0;
    interval->below = ratio_at(number, HALF_WIDTH, -1.0);
    interval->above = ratio_at(number, HALF_WIDTH, 1.0);
    set_bounds(scaled, interval);
    if (scaled->map->form.has_errors) {
        set_factors(scaled, interval);
    }
    return interval;
}

/* (c_a c_b - mean)_p, of the loads of the step. */
void set_products_of_coefficients(const Scaled *scaled, double *products) {
    double c[1 + N_LOADS] = {1.0}, scale[N_LOADS];
    coefficient_scales(scaled->step.pressure, scaled->map->reference_area, scaled->map->reference_length, scale);
    for (size_t i = 0; i < N_LOADS; i++) {
        c[1 + i] = scale[i] * scaled->step.loads[i];
    }
    for (size_t a = 0, pair = 0; a < 6; a++) {
        for (size_t b = a; b < 6; b++, pair++) {
            products[pair] = c[a] * c[b] - scaled->map->form.mean_product[pair];
        }
    }
}

/* The products, of the loads of the step as they are without these errors, and times Lagrange's polynomials. */
static void set_parts(Scaled *scaled) {
    CurrentErrors *errors = &scaled->errors;
    const Interval *interval = scaled->step.interval;
    const double middle = 0.5 * (interval->below + interval->above), half = 0.5 * (interval->above - interval->below);
    double part[N_NODES];
    lagrange(N_NODES, POINT, WEIGHT, (scaled->step.ratio - middle) / half, part);
    set_products_of_coefficients(scaled, errors->products);
    for (size_t j = 0; j < N_NODES; j++) {
        for (size_t pair = 0; pair < N_PAIRS; pair++) {
            errors->parts[j * N_PAIRS + pair] = part[j] * errors->products[pair];
        }
    }
}

/* G of the gauges in use, and E times G' and Y. */
void current_errors_take_lost(Scaled *scaled) {
    const size_t n = scaled->map->n_gauges, whole = dense_rows(n), common = 6 * scaled->map->form.n_terms;
    const ScaledStep *step = &scaled->step;
    CurrentErrors *errors = &scaled->errors;
    if (!scaled->map->form.has_errors) {
        return;
    }
    memcpy(errors->unresolved, step->unresolved, n * sizeof *errors->unresolved);
    set_gains(scaled, step->ratio);
    for (size_t k = 0; k < scaled->n_loads; k++) {
        double *gain = errors->gain + k * whole;
        lost_rows_take(scaled, k, gain);
        dense_times(scaled->wide, common, n, errors->rows, gain, errors->load_along + k * dense_rows(common));
    }
    for (size_t j = 0; j < step->n_lost; j++) {
        dense_times(scaled->wide, common, n, errors->rows, step->y + j * whole, errors->lost_along + j * dense_rows(common));
    }
}

static void set_own(Scaled *scaled) {
    const size_t n = scaled->map->n_gauges;
    CurrentErrors *errors = &scaled->errors;
    memset(errors->own, 0, n * sizeof *errors->own);
    for (size_t pair = 0; pair < N_PAIRS; pair++) {
        const double *restrict of_gauge = scaled->map->form.of_gauge + pair * n;
        for (size_t g = 0; g < n; g++) {
            errors->own[g] += errors->products[pair] * of_gauge[g];
        }
    }
}

/* D x for vectors of gauges x of which `along` is E x: own x in `product`, and M along in `sized`, where M (6, 6) is the
   symmetric matrix c c' - mean. Then y' D x = y' (own x) + (E y)' M E x. */
static void set_error(const Scaled *scaled, const double *x, const double *along) {
    const size_t n = scaled->map->n_gauges, common = 6 * scaled->map->form.n_terms;
    const CurrentErrors *errors = &scaled->errors;
    for (size_t g = 0; g < n; g++) {
        errors->product[g] = errors->own[g] * x[g];
    }
    memset(errors->sized, 0, common * sizeof *errors->sized);
    for (size_t first = 0; first < common; first += 6) {
        for (size_t a = 0, pair = 0; a < 6; a++) {
            for (size_t b = a; b < 6; b++, pair++) {
                errors->sized[first + a] += errors->products[pair] * along[first + b];
                errors->sized[first + b] += a == b ? 0.0 : errors->products[pair] * along[first + a];
            }
        }
    }
}

static double times_error(const Scaled *scaled, const double *y, const double *along) {
    const CurrentErrors *errors = &scaled->errors;
    return dot(scaled->map->n_gauges, y, errors->product) + dot(6 * scaled->map->form.n_terms, along, errors->sized);
}

/* G D G' of loads by the gauges in use, into `covariance` row by row, and what lost ones had of tr(P D). */
static double set_in_use(Scaled *scaled, double *covariance) {
    const size_t whole = dense_rows(scaled->map->n_gauges), common = dense_rows(6 * scaled->map->form.n_terms);
    const ScaledStep *step = &scaled->step;
    const CurrentErrors *errors = &scaled->errors;
    double trace = 0.0;
    set_own(scaled);
    for (size_t j = 0; j < N_LOADS; j++) {
        set_error(scaled, errors->gain + j * whole, errors->load_along + j * common);
        for (size_t i = 0; i <= j; i++) {
            covariance[i * N_LOADS + j - i * (i + 1) / 2] =
                times_error(scaled, errors->gain + i * whole, errors->load_along + i * common);
        }
    }
    for (size_t j = 0; j < step->n_lost; j++) {
        set_error(scaled, step->y + j * whole, errors->lost_along + j * common);
        trace += times_error(scaled, step->y + j * whole, errors->lost_along + j * common);
    }
    return trace;
}

const double *current_errors_values(Scaled *scaled) {
    double *value = scaled->errors.value;
    set_parts(scaled);
    dense_times(scaled->wide, N_VALUES, N_FACTORS, scaled->step.interval->factor, scaled->errors.parts, value);
    if (scaled->step.n_lost > 0) {
        value[TRACE] -= set_in_use(scaled, value);
    }
    return value;
}

/* The variance G_j D G_j' of load j: where all gauges are in use from its row of `factor`, which lies in panels. */
double current_errors_of_other(const Scaled *scaled, size_t j) {
    const size_t n = scaled->map->n_gauges, row = N_VALUES + j;
    const CurrentErrors *errors = &scaled->errors;
    if (scaled->step.n_lost > 0) {
        const double *gain = errors->gain + (N_LOADS + j) * dense_rows(n);
        const double *along = errors->load_along + (N_LOADS + j) * dense_rows(6 * scaled->map->form.n_terms);
        set_error(scaled, gain, along);
        return times_error(scaled, gain, along);
    }
    const double *panel = scaled->step.interval->factor + row / ROWS * ROWS * dense_columns(N_FACTORS) + row % ROWS;
    double sum = 0.0;
    for (size_t k = 0; k < N_FACTORS; k++) {
        sum += panel[k * ROWS] * errors->parts[k];
    }
    return sum;
}
