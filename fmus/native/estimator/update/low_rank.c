/* The update for many gauges whose errors are a few columns and one error of each gauge: diagonal plus low rank.

   n gauges in use at a pressure ratio s have independent errors of the variance a_i + s^2 b_i: noise and the zeros' own
   (a), own errors that grow with the pressure (b). All other errors are columns. With w_i = 1 / (a_i + s^2 b_i), 0 for
   a lost gauge, and r = d - d_0 - s m,

       r = s X x + s N y + c z + e,      f = f_0 + s (f_mean + M x + M_N y),      cov e = 1 / w,

   x free, y and z standard normal, c (n) what all zeros have in common. low_rank_prepare turns [X, N] once, at the
   weights w_ref of the largest s, to columns that are orthonormal there:

       w_ref^1/2 [X, N] = Q [T, Z; 0, K],   K = U diag(S) E,   E orthonormal rows
       F_free = M T^-1,   F_a = (M_N - F_free Z) E_a'         loads of a column, as in added_noise.c

   Columns of S up to SMALLEST are left out: so far below the noise of all gauges together they change precisions by S^2
   alone. Loads see them to first order by X_t = sum of their strain times loads (n, 5), and F_t (5, 5) is the
   covariance of these loads. H (n, order) are the columns that are kept, c and X, with the loads F / S, 0 and F_free,
   called F from here on; their sizes are s S, 1 and s. D^2 = 1 (0 for x) + size^2 K_cc keeps the diagonal of A at 1, t
   = size / D:

       K = [H, X_t, m]' W [H, X_t, m]                          Gram matrix, its columns g by X_t and g_m by m
       A = diag(prior / D^2) + t K t = L L',    C = t A^-1 t   information on the columns, and their covariance
       x = C H' W r,      e = r - H x
       chi-square = e' W e + |prior x / size|^2
       f = f_0 + s f_mean + F x + s^2 X_t' W e,                F' = F - s^2 g
       cov f = F' C F'' + s^2 F_t - s^4 X_t' W X_t,            df/dq by F' C g_m + s^2 X_t' W m as in scaled_form.c
       P_ii = w_i - w_i^2 h_i' C h_i,      z_i = w_i e_i / sqrt(P_ii),      G = (F' C H' + s^2 X_t') W

   A step costs two readings of [H, X_t, m]. C, g, cov f, P_ii, and G D G' and tr(P D) of current_errors.c follow s,
   which moves in flight. Each is analytic in s^2 but for the negative axis, so that in ln s the next singularity is pi / 2
   away: with Chebyshev points in an interval of half width h the error of their polynomial falls as rho^-LOW_NODES,
   rho = k + sqrt(k^2 + 1), k = pi / 2 / h. For a factor sqrt 2, h = 0.173 and rho = 18.2: twelve points leave 1e-14. An
   interval is filled when s enters it with a set of gauges, by 2 n order^2 LOW_NODES multiplications, and LOW_INTERVALS
   are kept. A lost gauge is a row of weight 0: what a step costs does not depend on how many there are. P_ii is good to
   the round-off of w_i: the form is for gauges that the columns do not determine, as where there are many more gauges
   than columns.

   docs/explanation/dynamic_pressure.md, "Many gauges". tests/estimator/reference/test_low_rank.py compares it with the dense
   update for the same gauges. */

#include "update.h"

#include "../../core/elementary.h"

#include <math.h>
#include <string.h>

#define SMALLEST 1e-5 /* S of a column that is kept, over the noise of all gauges */
#define BLOCK 64      /* gauges whose products are summed while they are in the cache */
#define TILE 8
#define LARGEST_RATIO 1024.0 /* of a map whose dynamic pressure has no limit */

static size_t states_of(const Map *map) {
    return map->n_states + map->n_errors;
}

/* Rows that the reflections of all columns leave, below the free states: of K. */
static size_t rows_of(const Map *map) {
    return (states_of(map) < map->n_gauges ? states_of(map) : map->n_gauges) - map->form.n_free;
}

static size_t most_columns(const Map *map) {
    return (states_of(map) + 1 + TILE) / TILE * TILE;
}

static size_t most_width(const Map *map) {
    return (most_columns(map) + N_LOADS + 1 + TILE - 1) / TILE * TILE;
}

void low_rank_arrays(Scaled *scaled, Room *room) {
    const Map *map = scaled->map;
    LowRank *low = &scaled->low;
    const size_t n = map->n_gauges, states = states_of(map), order = most_columns(map), width = most_width(map);
    const size_t terms = 6 * map->form.n_terms, n_free = map->form.n_free;
    low->row = taken(room, n * width);
    TAKE(room, order, &low->size, &low->prior);
    TAKE(room, width, &low->of_residual, &low->x);
    TAKE(room, N_LOADS * order, &low->load, &low->load_left);
    TAKE(room, n, &low->noise, &low->weight, &low->error, &low->weighted, &low->precision);
    low->covariance = taken(room, triangle_column(order));
    low->column = taken(room, (N_LOADS + 1) * order);
    for (size_t k = 0; k < LOW_INTERVALS; k++) {
        low->interval[k].covariance = taken(room, LOW_NODES * triangle_column(order));
        low->interval[k].column = taken(room, LOW_NODES * (N_LOADS + 1) * order);
        low->interval[k].precision = taken(room, LOW_NODES * n);
        low->interval[k].value = taken(room, LOW_NODES * N_LOW_VALUES);
    }
    /* Of an interval, or at a ratio of 1. */
    TAKE(room, n * order, &low->along, &low->nominal_along);
    TAKE(room, n, &low->nominal_weight, &low->nominal_precision, &low->sized, &low->vector);
    low->gram = taken(room, width * width);
    TAKE(room, order * order, &low->triangle, &low->inverse, &low->square);
    TAKE(room, order, &low->product, &low->scale, &low->ones);
    low->rows = taken(room, LANES * order);
    low->gain = taken(room, N_LOADS * n);
    low->of_term = taken(room, terms * order);
    low->term_load = taken(room, N_LOADS * terms);
    low->term_square = taken(room, terms * 6);
    TAKE(room, n_free * n_free, &low->all_free, &low->free);
    low->ratio = taken(room, n_free * n_free + n_free);
    low->all_gauges = piece(room, n, 1);
    /* Of the preparation alone. */
    low->whole = taken(room, n * states);
    low->head = taken(room, 2 * states);
    low->turned = taken(room, 2 * states * states);
    low->kept = taken(room, states * states);
    low->scratch = taken(room, orthogonal_rows_doubles(states, 2 * states));
    TAKE(room, N_LOADS * states, &low->of_free, &low->of_column);
    TAKE(room, n, &scaled->step.z, &scaled->step.w);
    scaled->step.lost = piece(room, n, sizeof *scaled->step.lost);
}

/* s^2 w grows with s: at the largest pressure columns are largest over the noise. */
static void set_reference(const Map *map, double *root) {
    const double most = map->envelope.dynamic_pressure[1] / map->dynamic_pressure;
    const double s = most > 1.0 && most < LARGEST_RATIO ? most : LARGEST_RATIO;
    for (size_t i = 0; i < map->n_gauges; i++) {
        root[i] = s / sqrt(map->noise_variance[i] + s * s * map->own_variance[i]);
    }
}

/* Q' w_ref^1/2 [X, N] in low->whole; T, Z, K on top of it. */
static void reflect_columns(Scaled *scaled, const double *root) {
    const Map *map = scaled->map;
    LowRank *low = &scaled->low;
    const size_t n = map->n_gauges;
    for (size_t c = 0; c < states_of(map); c++) {
        const double *column = c < map->n_states ? map->state_operator + c * n : map->error_strain + (c - map->n_states) * n;
        for (size_t i = 0; i < n; i++) {
            low->whole[c * n + i] = root[i] * column[i];
        }
    }
    householder_columns(scaled->wide, n, map->form.n_free + rows_of(map), states_of(map), low->whole, low->head);
}

/* F_free, and M_N - F_free Z by columns of N. */
static void split_loads(Scaled *scaled) {
    const Map *map = scaled->map;
    LowRank *low = &scaled->low;
    const size_t n = map->n_gauges, states = states_of(map), n_free = map->form.n_free;
    for (size_t i = 0; i < N_LOADS; i++) {
        double *row = low->of_free + i * states;
        for (size_t c = 0; c < n_free; c++) {
            row[c] = map->load_per_state[N_LOADS * c + i];
        }
        solve_transposed(n, n_free, low->whole, row);
        for (size_t c = n_free; c < states; c++) {
            const double load = c < map->n_states ? map->load_per_state[N_LOADS * c + i]
                                                  : map->error_load[N_LOADS * (c - map->n_states) + i];
            low->of_column[i * states + c - n_free] = load - dot(n_free, row, low->whole + c * n);
        }
    }
}

/* A column of gauges from one behind the reflections, where `vector` has its elements below the free states. */
static void set_column(Scaled *scaled, const double *root, size_t column) {
    LowRank *low = &scaled->low;
    const size_t n = scaled->map->n_gauges, pivots = scaled->map->form.n_free + rows_of(scaled->map);
    householder_back(scaled->wide, n, pivots, low->whole, low->head, low->vector);
    for (size_t i = 0; i < n; i++) {
        low->row[i * low->width + column] = low->vector[i] / root[i];
    }
}

/* U, S and E of K; the rows are [S E, U']. */
static void turn_columns(Scaled *scaled) {
    LowRank *low = &scaled->low;
    const size_t n = scaled->map->n_gauges, n_free = scaled->map->form.n_free, rows = rows_of(scaled->map);
    const size_t count = states_of(scaled->map) - n_free, width = count + rows;
    for (size_t i = 0; i < rows; i++) {
        double *row = low->turned + i * width;
        for (size_t c = 0; c < count; c++) {
            row[c] = c < i ? 0.0 : low->whole[(n_free + c) * n + n_free + i];
            low->kept[i * count + c] = row[c];
        }
        memset(row + count, 0, rows * sizeof *row);
        row[count + i] = 1.0;
    }
    Turned turned = {0};
    orthogonal_rows(scaled->wide, rows, count, width, low->turned, low->scratch, &turned, SIZE_MAX);
}

/* S of a turned row. */
static double size_of(const Scaled *scaled, size_t k) {
    const size_t count = states_of(scaled->map) - scaled->map->form.n_free;
    const double *row = scaled->low.turned + k * (count + rows_of(scaled->map));
    return sqrt(dot(count, row, row));
}

/* The kept columns by falling S, with their loads, which are taken off of_column. */
static size_t take_columns(Scaled *scaled, const double *root) {
    LowRank *low = &scaled->low;
    const size_t n = scaled->map->n_gauges, n_free = scaled->map->form.n_free, states = states_of(scaled->map);
    const size_t count = states - n_free, rows = rows_of(scaled->map);
    size_t kept = 0;
    for (size_t k = 0; k < rows; k++) {
        low->scratch[k] = size_of(scaled, k);
    }
    for (; kept < rows; kept++) {
        size_t best = 0;
        for (size_t k = 1; k < rows; k++) {
            best = low->scratch[k] > low->scratch[best] ? k : best;
        }
        const double *row = low->turned + best * (count + rows), size = low->scratch[best];
        if (!(size > SMALLEST)) {
            break;
        }
        low->scratch[best] = -1.0;
        low->size[kept] = size;
        memset(low->vector, 0, n * sizeof *low->vector);
        memcpy(low->vector + n_free, row + count, rows * sizeof *row);
        set_column(scaled, root, kept);
        for (size_t i = 0; i < N_LOADS; i++) {
            double *left = low->of_column + i * states;
            const double along = dot(count, left, row) / size;
            low->load[i * low->order + kept] = along / size;
            add_times(count, -along / size, row, left);
        }
    }
    return kept;
}

/* X_t, the strain of the columns that are left out times their loads, and F_t. */
static void take_rest(Scaled *scaled, const double *root) {
    LowRank *low = &scaled->low;
    const size_t n = scaled->map->n_gauges, n_free = scaled->map->form.n_free, states = states_of(scaled->map);
    const size_t count = states - n_free;
    for (size_t i = 0; i < N_LOADS; i++) {
        const double *left = low->of_column + i * states;
        memset(low->vector, 0, n * sizeof *low->vector);
        for (size_t k = 0; k < rows_of(scaled->map); k++) {
            low->vector[n_free + k] = dot(count, low->kept + k * count, left);
        }
        set_column(scaled, root, low->order + i);
        for (size_t j = 0; j < N_LOADS; j++) {
            low->rest[i * N_LOADS + j] = dot(count, left, low->of_column + j * states);
        }
    }
}

void low_rank_prepare(Scaled *scaled) {
    const Map *map = scaled->map;
    LowRank *low = &scaled->low;
    const size_t n = map->n_gauges, n_free = map->form.n_free;
    double *root = low->weighted;
    low->order = low->width = 0;
    set_reference(map, root);
    reflect_columns(scaled, root);
    split_loads(scaled);
    turn_columns(scaled);
    for (size_t k = 0; k < rows_of(map); k++) { /* columns are counted before rows are laid out */
        low->order += size_of(scaled, k) > SMALLEST;
    }
    low->order = (low->order + n_free + TILE) / TILE * TILE;
    low->width = (low->order + N_LOADS + 1 + TILE - 1) / TILE * TILE;
    memset(low->row, 0, n * low->width * sizeof *low->row);
    memset(low->load, 0, N_LOADS * low->order * sizeof *low->load);
    low->n_scaled = take_columns(scaled, root);
    take_rest(scaled, root);
    for (size_t c = 0; c < n_free; c++) {
        const size_t column = low->order - n_free + c;
        memset(low->vector, 0, n * sizeof *low->vector);
        low->vector[c] = 1.0;
        set_column(scaled, root, column);
        for (size_t i = 0; i < N_LOADS; i++) {
            low->load[i * low->order + column] = low->of_free[i * states_of(map) + c];
        }
    }
    for (size_t c = 0; c < low->order; c++) {
        low->prior[c] = c + n_free < low->order ? 1.0 : 0.0;
    }
    for (size_t i = 0; i < n; i++) {
        low->row[i * low->width + low->order + N_LOADS] = map->form.mean_strain[i];
    }
}

void low_rank_renew(Scaled *scaled, size_t n_strains, const double *zero_std) {
    const Map *map = scaled->map;
    LowRank *low = &scaled->low;
    const double common = zero_std[n_strains];
    low->common = map->common_variance + common * common;
    for (size_t i = 0; i < map->n_gauges; i++) {
        low->noise[i] = map->noise_variance[i] + zero_std[i] * zero_std[i];
        low->row[i * low->width + low->n_scaled] = sqrt(low->common);
    }
    for (size_t k = 0; k < LOW_INTERVALS; k++) {
        low->interval[k].number = NAN;
    }
    low->next = 0;
    low->grouped = 0;
    low->knows_all = 0;
    scaled->step.masked = NULL;
}

/* w; 0 for lost gauges. */
static void set_weight(const Scaled *scaled, const unsigned char *mask, double s, double *weight) {
    for (size_t i = 0; i < scaled->map->n_gauges; i++) {
        const double variance = scaled->low.noise[i] + s * s * scaled->map->own_variance[i];
        weight[i] = mask[i] ? 1.0 / variance : 0.0;
    }
}

/* The size of a column at a ratio. */
static double size_at(const LowRank *low, double s, size_t column) {
    if (column < low->n_scaled) {
        return s * low->size[column];
    }
    return low->prior[column] > 0.0 ? 1.0 : s;
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

/* g and g_m, and F' = F - s^2 g. */
static void set_columns(const LowRank *low, double s, double *column, double *load_left) {
    const size_t order = low->order;
    for (size_t k = 0; k <= N_LOADS; k++) {
        for (size_t c = 0; c < order; c++) {
            column[k * order + c] = low->gram[c * low->width + order + k];
        }
    }
    for (size_t k = 0; k < N_LOADS * order; k++) {
        load_left[k] = low->load[k] - s * s * column[k];
    }
}

/* C x of a packed C. */
EVERYWHERE void times_covariance(size_t order, const double *restrict covariance, const double *restrict x,
                                 double *restrict out) {
    memset(out, 0, order * sizeof *out);
    for (size_t i = 0; i < order; i++) {
        out[i] += sum_of_products(order - i, covariance, x + i);
        add_times(order - i - 1, x[i], covariance + 1, out + i + 1);
        covariance += order - i;
    }
}

/* cov f row by row (15), then F' C g_m + s^2 X_t' W m. */
static void set_base(const Scaled *scaled, double s, const double *covariance, const double *column, double *base) {
    const LowRank *low = &scaled->low;
    const size_t order = low->order, width = low->width;
    double *x = low->x, *of_mean = base + 15;
    for (size_t i = 0; i < N_LOADS; i++) {
        const double *gram = low->gram + (order + i) * width + order;
        times_covariance(order, covariance, low->load_left + i * order, x);
        for (size_t j = i; j < N_LOADS; j++) {
            const double rest = low->rest[i * N_LOADS + j] - s * s * gram[j];
            *base++ = dot(order, x, low->load_left + j * order) + s * s * rest;
        }
        of_mean[i] = dot(order, x, column + N_LOADS * order) + s * s * gram[N_LOADS];
    }
}

/* G of all gauges. */
static void set_gain(const Scaled *scaled, double s, const double *weight) {
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
            low->gain[i * n + g] = weight[g] * (dot(order, solved + i * order, low->along + g * order) + rest);
        }
    }
}

/* What own errors of the gauges at the current strain add, by pair of coefficients. */
static void add_own(const Scaled *scaled, const double *precision, double *value) {
    const LowRank *low = &scaled->low;
    const size_t n = scaled->map->n_gauges;
    for (size_t pair = 0; pair < N_PAIRS; pair++) {
        const double *of_gauge = scaled->map->form.of_gauge + pair * n;
        for (size_t i = 0, v = 0; i < N_LOADS; i++) {
            for (size_t g = 0; g < n; g++) {
                low->sized[g] = of_gauge[g] * low->gain[i * n + g];
            }
            for (size_t j = i; j < N_LOADS; j++, v++) {
                value[v * N_PAIRS + pair] += dot(n, low->sized, low->gain + j * n);
            }
        }
        value[(N_VALUES - 1) * N_PAIRS + pair] += dot(n, of_gauge, precision);
    }
}

/* The same of common errors: G E', and E' P E = E' W E - (B W E)' (B W E). */
static void add_common(Scaled *scaled, const double *weight, double *value) {
    LowRank *low = &scaled->low;
    const size_t n = scaled->map->n_gauges, order = low->order, terms = 6 * scaled->map->form.n_terms;
    const double *common = scaled->map->form.common;
    memset(low->of_term, 0, terms * order * sizeof *low->of_term);
    for (size_t t = 0; t < terms; t++) {
        for (size_t g = 0; g < n; g++) {
            low->sized[g] = weight[g] * common[t * n + g];
            add_times(order, low->sized[g], low->along + g * order, low->of_term + t * order);
        }
        for (size_t i = 0; i < N_LOADS; i++) {
            low->term_load[i * terms + t] = dot(n, low->gain + i * n, common + t * n);
        }
        for (size_t b = 0; b < 6; b++) {
            low->term_square[6 * t + b] = dot(n, low->sized, common + (t / 6 * 6 + b) * n);
        }
    }
    for (size_t first = 0; first < terms; first += 6) {
        for (size_t a = 0, pair = 0; a < 6; a++) {
            for (size_t b = a; b < 6; b++, pair++) {
                const double twice = a == b ? 1.0 : 2.0;
                const size_t p = first + a, q = first + b;
                double *of_pair = value + pair;
                for (size_t i = 0; i < N_LOADS; i++) {
                    for (size_t j = i; j < N_LOADS; j++, of_pair += N_PAIRS) {
                        *of_pair += 0.5 * twice * (low->term_load[i * terms + p] * low->term_load[j * terms + q]
                                                   + low->term_load[i * terms + q] * low->term_load[j * terms + p]);
                    }
                }
                *of_pair += twice * (low->term_square[6 * p + b]
                                     - dot(order, low->of_term + p * order, low->of_term + q * order));
            }
        }
    }
}

/* Chebyshev's points cos((2 k + 1) pi / 24), as constants, so that no platform rounds them otherwise. */
static const double POINT[LOW_NODES] = {0x1.fb9ea92ec689bp-1, 0x1.d906bcf328d46p-1, 0x1.963268b572492p-1,
                                        0x1.37af93f9513eap-1, 0x1.87de2a6aea963p-2, 0x1.0b5150f6da2d1p-3,
                                        -0x1.0b5150f6da2d1p-3, -0x1.87de2a6aea963p-2, -0x1.37af93f9513eap-1,
                                        -0x1.963268b572492p-1, -0x1.d906bcf328d46p-1, -0x1.fb9ea92ec689bp-1};

/* Polynomials of Lagrange at t. */
static void set_parts(double t, double part[LOW_NODES]) {
    for (size_t k = 0; k < LOW_NODES; k++) {
        part[k] = 1.0;
        for (size_t j = 0; j < LOW_NODES; j++) {
            part[k] *= j == k ? 1.0 : (t - POINT[j]) / (POINT[k] - POINT[j]);
        }
    }
}

static void fill(Scaled *scaled, const MaskedMap *masked, LowInterval *interval) {
    const Map *map = scaled->map;
    LowRank *low = &scaled->low;
    const size_t n = map->n_gauges, order = low->order;
    memset(interval->value, 0, LOW_NODES * N_LOW_VALUES * sizeof *interval->value);
    for (size_t k = 0; k < LOW_NODES; k++) {
        double *covariance = interval->covariance + k * triangle_column(order), *precision = interval->precision + k * n;
        double *column = interval->column + k * (N_LOADS + 1) * order, *value = interval->value + k * N_LOW_VALUES;
        const double s = interval->middle * exponential(LOW_HALF_WIDTH * POINT[k]);
        set_weight(scaled, masked->mask, s, low->weight);
        CHOSEN(scaled->wide, set_gram)(n, low->width, low->row, low->weight, low->gram);
        set_information(scaled, s);
        set_covariance(scaled, covariance);
        set_columns(low, s, column, low->load_left);
        set_base(scaled, s, covariance, column, value);
        set_precision(scaled, low->weight, low->along, precision);
        if (map->form.has_errors) {
            set_gain(scaled, s, low->weight);
            add_own(scaled, precision, value + N_BASE);
            add_common(scaled, low->weight, value + N_BASE);
        }
    }
}

/* The interval that holds a ratio, for a set of gauges; the oldest gives way. */
static const LowInterval *interval_at(Scaled *scaled, const MaskedMap *masked, double s) {
    LowRank *low = &scaled->low;
    const double place = logarithm(s) / (2.0 * LOW_HALF_WIDTH), whole = (double)(int)place;
    const double number = whole > place ? whole - 1.0 : whole;
    for (size_t k = 0; k < LOW_INTERVALS; k++) {
        if (low->interval[k].number == number && low->interval[k].gauges == masked->number) {
            return &low->interval[k];
        }
    }
    LowInterval *interval = &low->interval[low->next];
    low->next = (low->next + 1) % LOW_INTERVALS;
    interval->number = number;
    interval->gauges = masked->number;
    interval->middle = exponential((2.0 * number + 1.0) * LOW_HALF_WIDTH);
    fill(scaled, masked, interval);
    return interval;
}

/* The sums of `count` numbers at all points. */
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

/* Everything that follows from the gauges in use and the ratio. */
static void prepare_step(Scaled *scaled, const MaskedMap *masked, double s) {
    const Map *map = scaled->map;
    LowRank *low = &scaled->low;
    ScaledStep *step = &scaled->step;
    const size_t order = low->order;
    low->at = interval_at(scaled, masked, s);
    set_parts((logarithm(s) - logarithm(low->at->middle)) / LOW_HALF_WIDTH, low->part);
    CHOSEN(scaled->wide, interpolate)(triangle_column(order), low->at->covariance, low->part, low->covariance);
    CHOSEN(scaled->wide, interpolate)((N_LOADS + 1) * order, low->at->column, low->part, low->column);
    interpolate(N_LOW_VALUES, low->at->value, low->part, low->value);
    set_weight(scaled, masked->mask, s, low->weight);
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
    for (size_t i = 0; i < n; i++) {
        low->error[i] -= sum_of_products(order, low->row + i * width, low->x);
        low->weighted[i] = low->weight[i] * low->error[i];
    }
}

FOR_AVX2(solve_sample, (Scaled *scaled, const double *strain), (scaled, strain))

/* Errors at the current strain: to the covariance, and to the limits. */
static void add_errors(Scaled *scaled) {
    LowRank *low = &scaled->low;
    ScaledStep *step = &scaled->step;
    const double square = step->ratio * step->ratio, *value = low->value + N_BASE;
    double product[N_PAIRS];
    memcpy(step->covariance, step->base, sizeof step->covariance);
    if (!scaled->map->form.has_errors) {
        set_limit_ratio(scaled, 0.0);
        return;
    }
    set_products_of_coefficients(scaled, product);
    for (size_t i = 0; i < N_LOADS; i++) {
        for (size_t j = i; j < N_LOADS; j++, value += N_PAIRS) {
            step->covariance[i * N_LOADS + j] += square * dot(N_PAIRS, value, product);
            step->covariance[j * N_LOADS + i] = step->covariance[i * N_LOADS + j];
        }
    }
    set_limit_ratio(scaled, dot(N_PAIRS, value, product));
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
        CHOSEN(scaled->wide, interpolate)(scaled->map->n_gauges, low->at->precision, low->part, low->precision);
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

/* The root of A at a ratio of 1 for a set of gauges. 0 where it has none. */
static int set_nominal(Scaled *scaled, const unsigned char *mask) {
    LowRank *low = &scaled->low;
    set_weight(scaled, mask, 1.0, low->nominal_weight);
    CHOSEN(scaled->wide, set_gram)(scaled->map->n_gauges, low->width, low->row, low->nominal_weight, low->gram);
    return set_information(scaled, 1.0);
}

/* The root of the information on the free states, in their own units, by rows. */
static void free_root(const Scaled *scaled, double *root) {
    const LowRank *low = &scaled->low;
    const size_t n_free = scaled->map->form.n_free, order = low->order, first = order - n_free;
    for (size_t i = 0; i < n_free; i++) {
        for (size_t j = 0; j < n_free; j++) {
            const double element = low->triangle[(first + j) * order + first + i];
            root[i * n_free + j] = j > i ? 0.0 : low->scale[first + i] * element;
        }
    }
}

/* The roots R of the gauges in use, R_0 of all gauges: the square of the smallest singular value of R_0^-1 R. */
double low_rank_information(Scaled *scaled, const MaskedMap *masked) {
    LowRank *low = &scaled->low;
    const size_t n_free = scaled->map->form.n_free;
    if (!low->knows_all) {
        memset(low->all_gauges, 1, scaled->map->n_gauges);
        if (!set_nominal(scaled, low->all_gauges)) {
            return 0.0;
        }
        free_root(scaled, low->all_free);
        low->knows_all = 1;
    }
    if (!set_nominal(scaled, masked->mask)) {
        return 0.0;
    }
    free_root(scaled, low->free);
    for (size_t j = 0; j < n_free; j++) {
        for (size_t i = 0; i < n_free; i++) {
            double sum = low->free[i * n_free + j];
            for (size_t k = 0; k < i; k++) {
                sum -= low->all_free[i * n_free + k] * low->ratio[k * n_free + j];
            }
            low->ratio[i * n_free + j] = sum / low->all_free[i * n_free + i];
        }
    }
    const double smallest = smallest_singular_value(n_free, low->ratio, low->ratio + n_free * n_free);
    return smallest * smallest;
}

/* Whether the leave-one-out residuals of two gauges in use are correlated beyond the limit. */
static int correlated(const Scaled *scaled, size_t i, size_t j) {
    const LowRank *low = &scaled->low;
    const size_t order = low->order;
    const double product = dot(order, low->nominal_along + i * order, low->nominal_along + j * order);
    const double covariance = low->nominal_weight[i] * low->nominal_weight[j] * product;
    const double squares = low->nominal_precision[i] * low->nominal_precision[j];
    const double limit = scaled->map->ambiguous_correlation;
    return is_checked(scaled, i, low->nominal_precision[i]) && is_checked(scaled, j, low->nominal_precision[j])
        && covariance * covariance >= limit * limit * squares;
}

/* From the worst gauge on, those that a member of the group is correlated with join it. */
void low_rank_group(Scaled *scaled, MaskedMap *masked, size_t worst) {
    LowRank *low = &scaled->low;
    const size_t in_group = scaled->map->n_gauges; /* of members, before their first is known */
    size_t *group = masked->group, *member = scaled->step.lost, members = 1, first = worst;
    if (low->grouped != masked->number) {
        set_nominal(scaled, masked->mask);
        set_precision(scaled, low->nominal_weight, low->nominal_along, low->nominal_precision);
        low->grouped = masked->number;
    }
    for (size_t k = 0; k < masked->n_used; k++) {
        group[k] = k;
    }
    group[worst] = in_group;
    member[0] = worst;
    for (size_t next = 0; next < members; next++) {
        for (size_t k = 0; k < masked->n_used; k++) {
            if (group[k] != in_group && correlated(scaled, masked->used[member[next]], masked->used[k])) {
                group[k] = in_group;
                member[members++] = k;
                first = k < first ? k : first;
            }
        }
    }
    for (size_t k = 0; k < members; k++) {
        group[member[k]] = first;
    }
}
