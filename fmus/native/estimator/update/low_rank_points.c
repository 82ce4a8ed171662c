/* Many gauges: what a step needs, at points of the pressure ratio s, for the gauges in use.

   D^2 = 1 (0 for x) + size^2 K_cc keeps the diagonal of A at 1, t = size / D:

       K = [H, X_t, m]' W [H, X_t, m]                          Gram matrix, its columns g by X_t and g_m by m
       A = diag(prior / D^2) + t K t = L L',    C = t A^-1 t   information on the columns, and their covariance
       F' = F - s^2 g,      cov f = F' C F'' + s^2 F_t - s^4 X_t' W X_t,      df/dq by F' C g_m + s^2 X_t' W m
       P = W - W H C H' W,      G = (F' C H' + s^2 X_t') W

   C, g, cov f, P_ii, and G D G' and tr(P D) of current_errors.c follow s, which moves in flight. Each is analytic in s^2
   but for the negative axis, so that in ln s the next singularity is pi / 2 away: with Chebyshev points in an interval of
   half width h the error of their polynomial falls as rho^-LOW_NODES, rho = k + sqrt(k^2 + 1), k = pi / 2 / h. For a
   factor sqrt 2, h = 0.173 and rho = 18.2: twelve points leave 1e-14. An interval is filled when s enters it with a set of
   gauges, by 2 n order^2 LOW_NODES multiplications, and LOW_INTERVALS are kept.

   Up to MOST_SUBTRACTED lost gauges are taken off the interval of all gauges one by one, by n order LOW_NODES
   multiplications each, and off C at a ratio of 1, by which the others identify the free states. With y = C h_j and
   p = P e_j, which is -w_i w_j h_i' y but for P_jj, without gauge j

       C + y y' w_j^2 / P_jj,      P - p p' / P_jj,      G - G_j p' / P_jj,

   unless the other gauges hardly check it. The numbers of a set of gauges do not depend on what was lost before.

   low_rank.c goes on. */

#include "low_rank.h"

#include <math.h>

#define BLOCK 64           /* gauges whose products are summed while they are in the cache */
#define MOST_SUBTRACTED 16 /* lost gauges; of more a new interval costs less */
#define LEAST_CHECKED 1e-3 /* P_jj / w_j of a gauge that is subtracted */

void low_rank_weights(const Scaled *scaled, const unsigned char *mask, double s, double *weight) {
    for (size_t i = 0; i < scaled->map->n_gauges; i++) {
        const double variance = scaled->low.noise[i] + s * s * scaled->map->own_variance[i];
        weight[i] = mask[i] ? 1.0 / variance : 0.0;
    }
}

/* The tile of K from columns `first` and `second` on, of some gauges, added to it. */
EVERYWHERE void add_tile(size_t width, size_t count, const double *restrict row, const double *restrict weight, size_t first,
                         size_t second, double *restrict gram) {
    double sum[4][TILE];
    for (size_t i = 0; i < 4; i++) {
        for (size_t j = 0; j < TILE; j++) {
            sum[i][j] = gram[(first + i) * width + second + j];
        }
    }
    for (size_t g = 0; g < count; g++) {
        const double *a = row + g * width + first, *b = row + g * width + second;
        for (size_t i = 0; i < 4; i++) {
            const double weighted = weight[g] * a[i];
            for (size_t j = 0; j < TILE; j++) {
                sum[i][j] += weighted * b[j];
            }
        }
    }
    for (size_t i = 0; i < 4; i++) {
        for (size_t j = 0; j < TILE; j++) {
            gram[(first + i) * width + second + j] = sum[i][j];
        }
    }
}

/* K (width, width), right on and above its diagonal. */
EVERYWHERE void set_gram(size_t n, size_t width, const double *row, const double *weight, double *gram) {
    memset(gram, 0, width * width * sizeof *gram);
    for (size_t g = 0; g < n; g += BLOCK) {
        const size_t count = n - g < BLOCK ? n - g : BLOCK;
        for (size_t first = 0; first < width; first += 4) {
            for (size_t second = first / TILE * TILE; second < width; second += TILE) {
                add_tile(width, count, row + g * width, weight + g, first, second, gram);
            }
        }
    }
}

FOR_AVX2(set_gram, (size_t n, size_t width, const double *row, const double *weight, double *gram),
         (n, width, row, weight, gram))

/* t, D and L at a ratio, of K there. 0 where A has no root. */
static int set_information(Scaled *scaled, double s) {
    LowRank *low = &scaled->low;
    const size_t order = low->order, width = low->width;
    int good = 1;
    for (size_t c = 0; c < order; c++) {
        const double size = size_at(low, s, c);
        low->scale[c] = sqrt(low->prior[c] + size * size * low->gram[c * width + c]);
        low->product[c] = size / low->scale[c];
    }
    for (size_t i = 0; i < order; i++) {
        for (size_t j = i; j < order; j++) {
            low->triangle[i * order + j] = low->product[i] * low->gram[i * width + j] * low->product[j];
        }
        low->triangle[i * order + i] += low->prior[i] / (low->scale[i] * low->scale[i]);
    }
    cholesky(scaled->wide, order, low->triangle);
    for (size_t i = 0; i < order; i++) {
        good = good && low->triangle[i * order + i] > 0.0 && isfinite(low->triangle[i * order + i]);
    }
    return good;
}

/* B = L^-1 t h of all gauges, and P_ii. */
static void set_precision(const Scaled *scaled, const double *weight, double *along_rows, double *precision) {
    const LowRank *low = &scaled->low;
    const size_t n = scaled->map->n_gauges, order = low->order;
    for (size_t i = 0; i < n; i++) {
        for (size_t c = 0; c < order; c++) {
            along_rows[i * order + c] = low->product[c] * low->row[i * low->width + c];
        }
    }
    solve_lower(scaled->wide, order, low->triangle, n, along_rows);
    for (size_t i = 0; i < n; i++) {
        const double *along = along_rows + i * order;
        precision[i] = weight[i] - weight[i] * (weight[i] * dot(order, along, along));
    }
}

/* C = t L'^-1 L^-1 t, packed by rows from the diagonal on. */
static void set_covariance(Scaled *scaled, double *covariance) {
    LowRank *low = &scaled->low;
    const size_t order = low->order;
    invert_lower(scaled->wide, order, low->triangle, low->rows, low->inverse);
    for (size_t i = 0; i < order; i++) {
        low->ones[i] = 1.0;
        memset(low->inverse + i * order + i + 1, 0, (order - i - 1) * sizeof *low->inverse);
    }
    CHOSEN(scaled->wide, set_gram)(order, order, low->inverse, low->ones, low->square);
    for (size_t i = 0; i < order; i++) {
        for (size_t j = i; j < order; j++) {
            *covariance++ = low->product[i] * low->square[i * order + j] * low->product[j];
        }
    }
}

/* g and g_m, and X_t' W [X_t, m]. */
static void set_columns(const LowRank *low, double *column, double *left) {
    const size_t order = low->order;
    for (size_t k = 0; k <= N_LOADS; k++) {
        for (size_t c = 0; c < order; c++) {
            column[k * order + c] = low->gram[c * low->width + order + k];
        }
        for (size_t i = 0; i < N_LOADS; i++) { /* K is right above its diagonal */
            const size_t row = k < N_LOADS && i > k ? k : i, place = k < N_LOADS && i > k ? i : k;
            left[i * (N_LOADS + 1) + k] = low->gram[(order + row) * low->width + order + place];
        }
    }
}

/* F' = F - s^2 g. */
static void set_load_left(LowRank *low, double s, const double *column) {
    for (size_t k = 0; k < N_LOADS * low->order; k++) {
        low->load_left[k] = low->load[k] - s * s * column[k];
    }
}

/* cov f row by row (15), then F' C g_m + s^2 X_t' W m, of X_t' W [X_t, m] by rows. */
static void set_base(const Scaled *scaled, double s, const double *covariance, const double *column, const double *left,
                     double *base) {
    const LowRank *low = &scaled->low;
    const size_t order = low->order;
    double *x = low->x, *of_mean = base + 15;
    for (size_t i = 0; i < N_LOADS; i++) {
        const double *gram = left + i * (N_LOADS + 1);
        times_covariance(order, covariance, low->load_left + i * order, x);
        for (size_t j = i; j < N_LOADS; j++) {
            const double rest = low->rest[i * N_LOADS + j] - s * s * gram[j];
            *base++ = dot(order, x, low->load_left + j * order) + s * s * rest;
        }
        of_mean[i] = dot(order, x, column + N_LOADS * order) + s * s * gram[N_LOADS];
    }
}

/* G of all gauges. */
static void set_gain(const Scaled *scaled, double s, const double *weight, double *gain) {
    const LowRank *low = &scaled->low;
    const size_t n = scaled->map->n_gauges, order = low->order;
    double *solved = low->square; /* L^-1 t F' */
    for (size_t i = 0; i < N_LOADS; i++) {
        for (size_t c = 0; c < order; c++) {
            solved[i * order + c] = low->product[c] * low->load_left[i * order + c];
        }
    }
    solve_lower(scaled->wide, order, low->triangle, N_LOADS, solved);
    for (size_t i = 0; i < N_LOADS; i++) {
        for (size_t g = 0; g < n; g++) {
            const double rest = s * s * low->row[g * low->width + order + i];
            gain[i * n + g] = weight[g] * (dot(order, solved + i * order, low->along + g * order) + rest);
        }
    }
}

/* What own errors of the gauges at the current strain add, by pair of coefficients. */
static void add_own(const Scaled *scaled, const double *precision, const double *gain, double *value) {
    const LowRank *low = &scaled->low;
    const size_t n = scaled->map->n_gauges;
    for (size_t pair = 0; pair < N_PAIRS; pair++) {
        const double *of_gauge = scaled->map->form.of_gauge + pair * n;
        for (size_t i = 0, v = 0; i < N_LOADS; i++) {
            for (size_t g = 0; g < n; g++) {
                low->sized[g] = of_gauge[g] * gain[i * n + g];
            }
            for (size_t j = i; j < N_LOADS; j++, v++) {
                value[v * N_PAIRS + pair] += dot(n, low->sized, gain + j * n);
            }
        }
        value[TRACE * N_PAIRS + pair] += dot(n, of_gauge, precision);
    }
}

/* E' P E = E' W E - (B W E)' (B W E) of common errors. */
static void set_term_squares(Scaled *scaled, const double *weight, double *term_square) {
    LowRank *low = &scaled->low;
    const size_t n = scaled->map->n_gauges, order = low->order, terms = 6 * scaled->map->form.n_terms;
    const double *common = scaled->map->form.common;
    memset(low->of_term, 0, terms * order * sizeof *low->of_term);
    for (size_t t = 0; t < terms; t++) {
        for (size_t g = 0; g < n; g++) {
            low->sized[g] = weight[g] * common[t * n + g];
            add_times(order, low->sized[g], low->along + g * order, low->of_term + t * order);
        }
        for (size_t b = 0; b < 6; b++) {
            term_square[6 * t + b] = dot(n, low->sized, common + (t / 6 * 6 + b) * n);
        }
    }
    for (size_t t = 0; t < terms; t++) {
        for (size_t b = 0; b < 6; b++) {
            term_square[6 * t + b] -= dot(order, low->of_term + t * order, low->of_term + (t / 6 * 6 + b) * order);
        }
    }
}

/* Chebyshev's points cos((2 k + 1) pi / 24) and their weights for lagrange(), as constants, so that no platform rounds them
   otherwise. */
static const double POINT[LOW_NODES] = {0x1.fb9ea92ec689bp-1, 0x1.d906bcf328d46p-1, 0x1.963268b572492p-1,
                                        0x1.37af93f9513eap-1, 0x1.87de2a6aea963p-2, 0x1.0b5150f6da2d1p-3,
                                        -0x1.0b5150f6da2d1p-3, -0x1.87de2a6aea963p-2, -0x1.37af93f9513eap-1,
                                        -0x1.963268b572492p-1, -0x1.d906bcf328d46p-1, -0x1.fb9ea92ec689bp-1};

static const double WEIGHT[LOW_NODES] = {0x1.646c6bf3cd916p+4,  -0x1.053ec6f1f1b97p+6, 0x1.9f94c54c6c538p+6,
                                         -0x1.0ecc45ce4c30cp+7, 0x1.3b59d34cc5e2fp+7,  -0x1.5269c61f2f068p+7,
                                         0x1.5269c61f2f068p+7,  -0x1.3b59d34cc5e2fp+7, 0x1.0ecc45ce4c30cp+7,
                                         -0x1.9f94c54c6c538p+6, 0x1.053ec6f1f1b97p+6,  -0x1.646c6bf3cd916p+4};

/* What an interval holds at one of its points. */
typedef struct {
    double s, *covariance, *column, *precision, *value, *left, *gain, *term_square;
} Point;

static Point point_of(const Scaled *scaled, const LowInterval *interval, size_t k) {
    const size_t n = scaled->map->n_gauges, order = scaled->low.order, terms = 6 * scaled->map->form.n_terms;
    return (Point){.s = ratio_at(interval->number, LOW_HALF_WIDTH, POINT[k]),
                   .covariance = interval->covariance + k * triangle_column(order),
                   .column = interval->column + k * (N_LOADS + 1) * order,
                   .precision = interval->precision + k * n,
                   .value = interval->value + k * N_LOW_VALUES,
                   .left = interval->left + k * N_LOADS * (N_LOADS + 1),
                   .gain = interval->gain + k * N_LOADS * n,
                   .term_square = interval->term_square + k * 6 * terms};
}

/* Of what is known of a point, the numbers of a step. */
static void set_values(Scaled *scaled, const Point *point) {
    const Map *map = scaled->map;
    const size_t n = map->n_gauges, terms = 6 * map->form.n_terms;
    double load[6 * N_LOADS]; /* of a common error, by coefficient */
    memset(point->value, 0, N_LOW_VALUES * sizeof *point->value);
    set_base(scaled, point->s, point->covariance, point->column, point->left, point->value);
    if (map->form.has_errors) {
        add_own(scaled, point->precision, point->gain, point->value + N_BASE);
        for (size_t first = 0; first < terms; first += 6) {
            for (size_t k = 0; k < 6 * N_LOADS; k++) {
                load[k] = dot(n, point->gain + k % N_LOADS * n, map->form.common + (first + k / N_LOADS) * n);
            }
            add_common_error(N_LOADS, load, point->term_square + 6 * first, point->value + N_BASE);
        }
    }
}

static void fill(Scaled *scaled, const unsigned char *mask, LowInterval *interval) {
    const Map *map = scaled->map;
    LowRank *low = &scaled->low;
    const size_t n = map->n_gauges;
    for (size_t k = 0; k < LOW_NODES; k++) {
        const Point point = point_of(scaled, interval, k);
        low_rank_weights(scaled, mask, point.s, low->weight);
        CHOSEN(scaled->wide, set_gram)(n, low->width, low->row, low->weight, low->gram);
        set_information(scaled, point.s);
        set_covariance(scaled, point.covariance);
        set_columns(low, point.column, point.left);
        set_load_left(low, point.s, point.column);
        set_precision(scaled, low->weight, low->along, point.precision);
        if (map->form.has_errors) {
            set_gain(scaled, point.s, low->weight, point.gain);
            set_term_squares(scaled, low->weight, point.term_square);
        }
        set_values(scaled, &point);
    }
}

/* p of gauge j, of h_i' y. */
EVERYWHERE void set_precision_column(size_t n, size_t width, size_t order, const double *restrict row,
                                     const double *restrict weight, const double *restrict y, size_t j,
                                     double *restrict out) {
    for (size_t g = 0; g < n; g++) {
        out[g] = weight[g] > 0.0 ? -weight[j] * (weight[g] * sum_of_products(order, row + g * width, y)) : 0.0;
    }
}

FOR_AVX2(set_precision_column, (size_t n, size_t width, size_t order, const double *row, const double *weight,
                                const double *y, size_t j, double *out), (n, width, order, row, weight, y, j, out))

/* C + factor y y', packed. */
static void add_square(size_t order, double factor, const double *y, double *covariance) {
    for (size_t i = 0; i < order; covariance += order - i, i++) {
        add_times(order - i, factor * y[i], y + i, covariance);
    }
}

/* Take gauge j off a point. 0 where the others hardly check it. */
static int subtract(Scaled *scaled, const Point *point, size_t j) {
    const Map *map = scaled->map;
    LowRank *low = &scaled->low;
    const size_t n = map->n_gauges, order = low->order, terms = 6 * map->form.n_terms;
    const double w = low->weight[j], checked = point->precision[j], *row = low->row + j * low->width;
    double *p = low->vector, *y = low->x;
    if (!(checked > LEAST_CHECKED * w)) {
        return 0;
    }
    times_covariance(order, point->covariance, row, y);
    CHOSEN(scaled->wide, set_precision_column)(n, low->width, order, low->row, low->weight, y, j, p);
    p[j] = checked;
    add_square(order, w * (w / checked), y, point->covariance);
    for (size_t k = 0; k <= N_LOADS; k++) {
        add_times(order, -w * row[order + k], row, point->column + k * order);
        for (size_t i = 0; i < N_LOADS; i++) {
            point->left[i * (N_LOADS + 1) + k] -= w * row[order + i] * row[order + k];
        }
    }
    for (size_t t = 0; map->form.has_errors && t < terms; t++) {
        low->of_term[t] = dot(n, p, map->form.common + t * n);
    }
    for (size_t t = 0; map->form.has_errors && t < terms; t++) {
        for (size_t b = 0; b < 6; b++) {
            point->term_square[6 * t + b] -= low->of_term[t] * low->of_term[t / 6 * 6 + b] / checked;
        }
    }
    for (size_t i = 0; map->form.has_errors && i < N_LOADS; i++) {
        add_times(n, -point->gain[i * n + j] / checked, p, point->gain + i * n);
        point->gain[i * n + j] = 0.0;
    }
    for (size_t g = 0; g < n; g++) {
        point->precision[g] -= p[g] * p[g] / checked;
    }
    point->precision[j] = low->weight[j] = 0.0;
    return 1;
}

/* Fill an interval from that of all gauges. 0 where a lost gauge cannot be taken off. */
static int fill_without(Scaled *scaled, const MaskedMap *masked, const LowInterval *all, LowInterval *interval) {
    LowRank *low = &scaled->low;
    const size_t n = scaled->map->n_gauges, order = low->order, terms = 6 * scaled->map->form.n_terms;
    for (size_t k = 0; k < LOW_NODES; k++) {
        const Point of_all = point_of(scaled, all, k), point = point_of(scaled, interval, k);
        memcpy(point.covariance, of_all.covariance, triangle_column(order) * sizeof *point.covariance);
        memcpy(point.column, of_all.column, (N_LOADS + 1) * order * sizeof *point.column);
        memcpy(point.precision, of_all.precision, n * sizeof *point.precision);
        memcpy(point.left, of_all.left, N_LOADS * (N_LOADS + 1) * sizeof *point.left);
        memcpy(point.gain, of_all.gain, N_LOADS * n * sizeof *point.gain);
        memcpy(point.term_square, of_all.term_square, 6 * terms * sizeof *point.term_square);
        low_rank_weights(scaled, low->all_gauges, point.s, low->weight);
        for (size_t j = 0; j < n; j++) {
            if (!masked->mask[j] && !subtract(scaled, &point, j)) {
                return 0;
            }
        }
        set_load_left(low, point.s, point.column);
        set_values(scaled, &point);
    }
    return 1;
}

/* The interval of a number for a set of gauges, 0 for all; `known` where it is filled, otherwise in the place of the oldest
   but `kept`. */
static LowInterval *interval_of(LowRank *low, double number, unsigned long gauges, const LowInterval *kept, int *known) {
    for (size_t k = 0; k < LOW_INTERVALS; k++) {
        if (low->interval[k].number == number && low->interval[k].gauges == gauges) {
            *known = 1;
            return &low->interval[k];
        }
    }
    low->next = (low->next + (&low->interval[low->next] == kept)) % LOW_INTERVALS;
    LowInterval *interval = &low->interval[low->next];
    low->next = (low->next + 1) % LOW_INTERVALS;
    interval->number = number;
    interval->gauges = gauges;
    *known = 0;
    return interval;
}

/* The interval of a number for a set of gauges, filled. */
static const LowInterval *filled(Scaled *scaled, const MaskedMap *masked, double number) {
    LowRank *low = &scaled->low;
    const size_t n = scaled->map->n_gauges, lost = n - masked->n_used;
    const int by_all = lost > 0 && lost <= MOST_SUBTRACTED;
    int known;
    LowInterval *interval = interval_of(low, number, lost > 0 ? masked->number : 0, NULL, &known);
    if (known) {
        return interval;
    }
    if (by_all) {
        LowInterval *all = interval_of(low, number, 0, interval, &known);
        if (!known) {
            fill(scaled, low->all_gauges, all);
        }
        if (fill_without(scaled, masked, all, interval)) {
            return interval;
        }
    }
    fill(scaled, masked->mask, interval);
    return interval;
}

EVERYWHERE void interpolate(size_t count, const double *restrict at_points, const double *restrict part, double *restrict out) {
    memset(out, 0, count * sizeof *out);
    for (size_t k = 0; k < LOW_NODES; k += 4) {
        const double *a = at_points + k * count, *b = a + count, *c = b + count, *d = c + count;
        for (size_t i = 0; i < count; i++) {
            out[i] += (part[k] * a[i] + part[k + 1] * b[i]) + (part[k + 2] * c[i] + part[k + 3] * d[i]);
        }
    }
}

FOR_AVX2(interpolate, (size_t count, const double *at_points, const double *part, double *out),
         (count, at_points, part, out))

void low_rank_between(const Scaled *scaled, size_t count, const double *at_points, double *out) {
    CHOSEN(scaled->wide, interpolate)(count, at_points, scaled->low.part, out);
}

void low_rank_at(Scaled *scaled, const MaskedMap *masked, double s) {
    LowRank *low = &scaled->low;
    double t;
    low->at = filled(scaled, masked, ratio_interval(s, LOW_HALF_WIDTH, &t));
    lagrange(LOW_NODES, POINT, WEIGHT, t, low->part);
}

/* w and the root of A at a ratio of 1; 0 where it has none. */
static int set_nominal(Scaled *scaled, const unsigned char *mask, double *weight) {
    LowRank *low = &scaled->low;
    low_rank_weights(scaled, mask, 1.0, weight);
    CHOSEN(scaled->wide, set_gram)(scaled->map->n_gauges, low->width, low->row, weight, low->gram);
    return set_information(scaled, 1.0);
}

/* C at a ratio of 1 of all gauges becomes that of a set. 0 where the others hardly check a gauge that is lost. */
static int take_off_lost(Scaled *scaled, const unsigned char *mask, double *covariance) {
    LowRank *low = &scaled->low;
    const size_t n = scaled->map->n_gauges, order = low->order;
    low_rank_weights(scaled, low->all_gauges, 1.0, low->sized);
    for (size_t j = 0; j < n; j++) {
        if (mask[j]) {
            continue;
        }
        const double w = low->sized[j], *row = low->row + j * low->width;
        times_covariance(order, covariance, row, low->x);
        const double checked = w - w * (w * dot(order, row, low->x));
        if (!(checked > LEAST_CHECKED * w)) {
            return 0;
        }
        add_square(order, w * (w / checked), low->x, covariance);
    }
    return 1;
}

int low_rank_nominal_covariance(Scaled *scaled, const unsigned char *mask, size_t n_lost, double *covariance) {
    LowRank *low = &scaled->low;
    if (n_lost > 0 && n_lost <= MOST_SUBTRACTED) {
        memcpy(covariance, low->of_all, triangle_column(low->order) * sizeof *covariance);
        if (take_off_lost(scaled, mask, covariance)) {
            return 1;
        }
    }
    if (!set_nominal(scaled, mask, low->sized)) {
        return 0;
    }
    set_covariance(scaled, covariance);
    return 1;
}

void low_rank_set_precisions(Scaled *scaled, const MaskedMap *masked) {
    LowRank *low = &scaled->low;
    if (low->grouped != masked->number) {
        set_nominal(scaled, masked->mask, low->nominal_weight);
        set_precision(scaled, low->nominal_weight, low->nominal_along, low->nominal_precision);
        low->grouped = masked->number;
    }
}
