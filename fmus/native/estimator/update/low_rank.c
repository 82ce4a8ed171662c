/* The update for many gauges whose errors are a few columns and one error of each gauge: diagonal plus low rank.

   n gauges in use at a pressure ratio s have independent errors of the variance a_i + s^2 b_i: noise and the zeros' own
   (a), own errors that grow with the pressure (b). All other errors are columns. With w_i = 1 / (a_i + s^2 b_i), 0 for
   a lost gauge, and r = d - d_0 - s m,

       r = s X x + s N y + c z + e,      f = f_0 + s (f_mean + M x + M_N y),      cov e = 1 / w,

   x free, y and z standard normal, c (n) what all zeros have in common. low_rank_prepare turns [X, N] once, at the
   weights w_ref of the largest s, to columns that are orthonormal there:

       w_ref^1/2 [X, N] = Q [T, Z; 0, K],   K = U diag(S) E,   E orthonormal rows
       F_free = M T^-1,   F_a = (M_N - F_free Z) E_a'         loads of a column, as in added_noise.c

   Columns of S up to SMALLEST are left out: with S a thousandth of a thousandth of the noise of all gauges together
   they change precisions by S^2 alone. Loads see them to first order by X_t = sum of their strain times loads (n, 5),
   and F_t (5, 5) is the covariance of these loads. H (n, order) are the columns that are kept, c and X; t their sizes
   (s S, 1, s), over D, where D^2 = 1 (0 for x) + size^2 K_cc keeps the diagonal of A at 1.

       K = [H, X_t, m]' W [H, X_t, m]                          Gram matrix
       A = diag(prior / D^2) + t K t = L L'                    information on the columns
       v = A^-1 t H' W r,      e = r - H t v
       chi-square = e' W e + |prior v / D|^2
       f = f_0 + s f_mean + load v + s^2 X_t' W e,             load = s F / D
       cov f = Y' Y + s^2 F_t - s^4 X_t' W X_t,                Y = L^-1 (load' - s^2 t H' W X_t)
       P_ii = w_i - w_i^2 |B_i|^2,     B_i = L^-1 t h_i,       z_i = w_i e_i / sqrt(P_ii)
       G = (Y' B + s^2 X_t') W

   A step costs two readings of [H, X_t, m]. K, P_ii, G D G' and tr(P D) of current_errors.c follow s, which moves in
   flight. Each is analytic in s^2 but for the negative axis, so that in x = ln s the next singularity is pi / 2 away:
   with Chebyshev points in an interval of half width h the error of their polynomial falls as rho^-LOW_NODES, rho =
   k + sqrt(k^2 + 1), k = pi / 2 / h. For a factor sqrt 2, h = 0.173, rho = 18.2: ten points leave 1e-12. An interval is
   filled when s enters it with a set of gauges, at the cost of n order^2 LOW_NODES multiplications, and LOW_INTERVALS
   are kept. A lost gauge is a row of weight 0: what a step costs does not depend on how many there are.

   docs/explanation/dynamic_pressure.md, "Many gauges". tests/estimator/test_low_rank.py compares it with the dense
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
    return (states_of(map) + 1 + LANES) / LANES * LANES + LANES;
}

static size_t most_width(const Map *map) {
    return (most_columns(map) + N_LOADS + 1 + TILE - 1) / TILE * TILE;
}

void low_rank_arrays(Scaled *scaled, Room *room) {
    const Map *map = scaled->map;
    LowRank *low = &scaled->low;
    ScaledStep *step = &scaled->step;
    const size_t n = map->n_gauges, states = states_of(map), order = most_columns(map), width = most_width(map);
    const size_t terms = 6 * map->form.n_terms;
    low->row = taken(room, n * width);
    TAKE(room, n * order, &low->along, &low->nominal_along);
    TAKE(room, width * width, &low->gram, &low->nominal_gram);
    TAKE(room, order * order, &low->at_step.triangle, &low->nominal.triangle);
    TAKE(room, order, &low->at_step.product, &low->at_step.scale, &low->nominal.product, &low->nominal.scale);
    TAKE(room, width, &low->size, &low->prior, &low->of_residual, &low->v);
    TAKE(room, N_LOADS * order, &low->load, &low->load_at, &low->solved);
    TAKE(room, n, &low->noise, &low->weight, &low->weighted, &low->error, &low->sized, &low->nominal_weight,
         &low->nominal_precision);
    low->gain = taken(room, N_LOADS * n);
    low->of_term = taken(room, terms * order);
    TAKE(room, terms, &low->term_load[0], &low->term_load[1], &low->term_load[2], &low->term_load[3], &low->term_load[4]);
    low->term_square = taken(room, terms * 6);
    low->all_free = taken(room, map->n_states * map->n_states);
    TAKE(room, map->n_states * map->n_states + map->n_states, &low->free, &low->ratio);
    for (size_t k = 0; k < LOW_INTERVALS; k++) {
        low->interval[k].gram = taken(room, LOW_NODES * width * width);
        low->interval[k].precision = taken(room, LOW_NODES * n);
        low->interval[k].value = taken(room, LOW_NODES * N_VALUES * N_PAIRS);
    }
    /* Of the preparation alone. */
    low->whole = taken(room, n * states);
    low->all_gauges = piece(room, n, 1);
    low->head = taken(room, 2 * states);
    low->turned = taken(room, 2 * states * states);
    low->kept = taken(room, states * states);
    low->scratch = taken(room, orthogonal_rows_doubles(states, 2 * states));
    TAKE(room, N_LOADS * states, &low->of_free, &low->of_column);
    low->vector = taken(room, n);
    TAKE(room, n, &step->z, &step->w);
    step->lost = piece(room, n, sizeof *step->lost);
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
            low->load[i * low->order + kept] = along;
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
    low->order = in_lanes(low->order + 1 + n_free);
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
        low->interval[k].below = NAN;
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

/* The sizes over D, the loads, A and its root, for the K at a ratio. 0 where A is none. */
static int set_information(const Scaled *scaled, double s, const double *gram, const InformationRoot *root) {
    const LowRank *low = &scaled->low;
    const size_t order = low->order, width = low->width, n_free = scaled->map->form.n_free;
    double *triangle = root->triangle;
    for (size_t c = 0; c < order; c++) {
        const double size = c < low->n_scaled ? s * low->size[c] : c + n_free < order ? 1.0 : s;
        const double scale = sqrt(low->prior[c] + size * size * gram[c * width + c]);
        root->product[c] = size / scale;
        root->scale[c] = scale;
    }
    for (size_t i = 0; i < order; i++) {
        for (size_t j = i; j < order; j++) {
            triangle[i * order + j] = root->product[i] * gram[i * width + j] * root->product[j];
        }
        triangle[i * order + i] += low->prior[i] / (root->scale[i] * root->scale[i]);
    }
    cholesky(scaled->wide, order, triangle);
    int good = 1;
    for (size_t i = 0; i < order; i++) {
        good = good && triangle[i * order + i] > 0.0 && isfinite(triangle[i * order + i]);
    }
    return good;
}

/* load = s F / D and Y. */
static void set_loads(Scaled *scaled, double s, const double *gram) {
    LowRank *low = &scaled->low;
    const size_t order = low->order, width = low->width;
    for (size_t i = 0; i < N_LOADS; i++) {
        for (size_t c = 0; c < order; c++) {
            const double load = s * low->load[i * order + c] / low->at_step.scale[c];
            low->load_at[i * order + c] = load;
            low->solved[i * order + c] = load - s * s * (low->at_step.product[c] * gram[c * width + order + i]);
        }
    }
    solve_lower(scaled->wide, order, low->at_step.triangle, N_LOADS, low->solved);
}

/* B of all gauges, and P_ii. */
static void set_precision(const Scaled *scaled, const double *weight, const InformationRoot *root, double *along_rows,
                          double *precision) {
    const LowRank *low = &scaled->low;
    const size_t n = scaled->map->n_gauges, order = low->order;
    for (size_t i = 0; i < n; i++) {
        const double *row = low->row + i * low->width;
        for (size_t c = 0; c < order; c++) {
            along_rows[i * order + c] = root->product[c] * row[c];
        }
    }
    solve_lower(scaled->wide, order, root->triangle, n, along_rows);
    for (size_t i = 0; i < n; i++) {
        const double *along = along_rows + i * order;
        precision[i] = weight[i] - weight[i] * (weight[i] * dot(order, along, along));
    }
}

static double gain_of(const Scaled *scaled, double s, size_t load, size_t gauge) {
    const LowRank *low = &scaled->low;
    const size_t order = low->order;
    return dot(order, low->solved + load * order, low->along + gauge * order)
         + s * s * low->row[gauge * low->width + order + load];
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
            low->term_load[i][t] = dot(n, low->gain + i * n, common + t * n);
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
                        *of_pair += 0.5 * twice * (low->term_load[i][p] * low->term_load[j][q]
                                                   + low->term_load[i][q] * low->term_load[j][p]);
                    }
                }
                *of_pair += twice * (low->term_square[6 * p + b]
                                     - dot(order, low->of_term + p * order, low->of_term + q * order));
            }
        }
    }
}

/* Chebyshev's points cos((2 k + 1) pi / 20), as constants, so that no platform rounds them otherwise. */
static const double POINT[LOW_NODES] = {0x1.f9b24942fe45cp-1,  0x1.c83201d3d2c6dp-1,  0x1.6a09e667f3bcdp-1,
                                        0x1.d0e2e2b44de01p-2,  0x1.4060b67a85375p-3,  -0x1.4060b67a85375p-3,
                                        -0x1.d0e2e2b44de01p-2, -0x1.6a09e667f3bcdp-1, -0x1.c83201d3d2c6dp-1,
                                        -0x1.f9b24942fe45cp-1};

/* Polynomials of Lagrange at a point t. */
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
    const size_t n = map->n_gauges, width = low->width;
    memset(interval->value, 0, LOW_NODES * N_VALUES * N_PAIRS * sizeof *interval->value);
    for (size_t k = 0; k < LOW_NODES; k++) {
        double *gram = interval->gram + k * width * width, *precision = interval->precision + k * n;
        double *value = interval->value + k * N_VALUES * N_PAIRS;
        const double s = interval->middle * exponential(LOW_HALF_WIDTH * POINT[k]);
        set_weight(scaled, masked->mask, s, low->weight);
        CHOSEN(scaled->wide, set_gram)(n, width, low->row, low->weight, gram);
        set_information(scaled, s, gram, &low->at_step);
        set_loads(scaled, s, gram);
        set_precision(scaled, low->weight, &low->at_step, low->along, precision);
        if (map->form.has_errors) {
            for (size_t i = 0; i < N_LOADS; i++) {
                for (size_t g = 0; g < n; g++) {
                    low->gain[i * n + g] = low->weight[g] * gain_of(scaled, s, i, g);
                }
            }
            add_own(scaled, precision, value);
            add_common(scaled, low->weight, value);
        }
    }
}

/* The interval that holds a ratio, for a set of gauges; the oldest gives way. */
static const LowInterval *interval_at(Scaled *scaled, const MaskedMap *masked, double s) {
    LowRank *low = &scaled->low;
    const double number = floor(logarithm(s) / (2.0 * LOW_HALF_WIDTH));
    for (size_t k = 0; k < LOW_INTERVALS; k++) {
        if (low->interval[k].below == number && low->interval[k].number == masked->number) {
            return &low->interval[k];
        }
    }
    LowInterval *interval = &low->interval[low->next];
    low->next = (low->next + 1) % LOW_INTERVALS;
    interval->below = number;
    interval->number = masked->number;
    interval->middle = exponential((2.0 * number + 1.0) * LOW_HALF_WIDTH);
    fill(scaled, masked, interval);
    return interval;
}

/* sum of the parts of `count` numbers at each point. */
EVERYWHERE void interpolate(size_t count, size_t apart, const double *restrict at_points, const double *restrict part,
                            double *restrict out) {
    for (size_t i = 0; i < count; i++) {
        out[i] = part[0] * at_points[i];
    }
    for (size_t k = 1; k < LOW_NODES; k++) {
        for (size_t i = 0; i < count; i++) {
            out[i] += part[k] * at_points[k * apart + i];
        }
    }
}

FOR_AVX2(interpolate, (size_t count, size_t apart, const double *at_points, const double *part, double *out),
         (count, apart, at_points, part, out))

/* Everything that follows from the gauges in use and the ratio. */
static void prepare_step(Scaled *scaled, const MaskedMap *masked, double s) {
    const Map *map = scaled->map;
    LowRank *low = &scaled->low;
    ScaledStep *step = &scaled->step;
    const size_t order = low->order, width = low->width, end = order + N_LOADS;
    low->at = interval_at(scaled, masked, s);
    set_parts((logarithm(s) - logarithm(low->at->middle)) / LOW_HALF_WIDTH, low->part);
    for (size_t i = 0; i < width; i++) {
        const size_t first = i / TILE * TILE;
        CHOSEN(scaled->wide, interpolate)(width - first, width * width, low->at->gram + i * width + first, low->part,
                                          low->gram + i * width + first);
    }
    set_weight(scaled, masked->mask, s, low->weight);
    set_information(scaled, s, low->gram, &low->at_step);
    set_loads(scaled, s, low->gram);
    for (size_t c = 0; c < order; c++) {
        low->v[c] = low->at_step.product[c] * low->gram[c * width + end];
    }
    solve_lower(scaled->wide, order, low->at_step.triangle, 1, low->v);
    for (size_t i = 0; i < N_LOADS; i++) {
        const double *solved = low->solved + i * order;
        const double of_mean = dot(order, solved, low->v) + s * s * low->gram[(order + i) * width + end];
        step->per_pressure[i] = (map->form.load_of_mean[i] - of_mean) / map->dynamic_pressure;
        for (size_t j = i; j < N_LOADS; j++) {
            const double squares = dot(order, solved, low->solved + j * order);
            const double left = low->rest[i * N_LOADS + j] - s * s * low->gram[(order + i) * width + order + j];
            step->base[i * N_LOADS + j] = step->base[j * N_LOADS + i] = squares + s * s * left;
        }
    }
    step->masked = masked;
    step->number = masked->number;
    step->ratio = s;
    step->n_lost = map->n_gauges - masked->n_used;
}

/* H' W r of all columns, four gauges at a time. */
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

/* r - H x. */
EVERYWHERE void take_rows(size_t n, size_t width, size_t order, const double *restrict row, const double *restrict x,
                          double *restrict residual) {
    for (size_t g = 0; g < n; g++) {
        residual[g] -= sum_of_products(order, row + g * width, x);
    }
}

/* r, then v and e. */
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
    for (size_t c = 0; c < order; c++) {
        low->v[c] = low->at_step.product[c] * low->of_residual[c];
    }
    solve_lower(scaled->wide, order, low->at_step.triangle, 1, low->v);
    solve_upper(scaled->wide, order, low->at_step.triangle, 1, low->v);
    for (size_t c = 0; c < order; c++) {
        low->of_residual[c] = low->at_step.product[c] * low->v[c];
    }
    take_rows(n, width, order, low->row, low->of_residual, low->error);
}

FOR_AVX2(solve_sample, (Scaled *scaled, const double *strain), (scaled, strain))

/* What errors at the current strain add to the covariance; the trace of P D. */
static double add_errors(Scaled *scaled) {
    const ScaledForm *form = &scaled->map->form;
    const LowRank *low = &scaled->low;
    ScaledStep *step = &scaled->step;
    double power[N_PAIRS], value[N_VALUES] = {0.0};
    memcpy(step->covariance, step->base, sizeof step->covariance);
    if (!form->has_errors) {
        return 0.0;
    }
    set_products_of_coefficients(scaled, power);
    for (size_t k = 0; k < LOW_NODES; k++) {
        for (size_t v = 0; v < N_VALUES; v++) {
            value[v] += low->part[k] * dot(N_PAIRS, low->at->value + (k * N_VALUES + v) * N_PAIRS, power);
        }
    }
    for (size_t i = 0, v = 0; i < N_LOADS; i++) {
        for (size_t j = i; j < N_LOADS; j++, v++) {
            step->covariance[i * N_LOADS + j] += step->ratio * step->ratio * value[v];
            step->covariance[j * N_LOADS + i] = step->covariance[i * N_LOADS + j];
        }
    }
    return value[N_VALUES - 1];
}

void low_rank_condition(Scaled *scaled, const MaskedMap *masked, const double *strain) {
    const ScaledForm *form = &scaled->map->form;
    LowRank *low = &scaled->low;
    ScaledStep *step = &scaled->step;
    const size_t n = scaled->map->n_gauges, order = low->order, width = low->width;
    const double s = step->pressure / scaled->map->dynamic_pressure;
    if (step->masked != masked || step->number != masked->number || step->ratio != s) {
        prepare_step(scaled, masked, s);
    }
    CHOSEN(scaled->wide, solve_sample)(scaled, strain);
    step->chi_square = 0.0;
    for (size_t i = 0; i < n; i++) {
        low->weighted[i] = low->weight[i] * low->error[i];
    }
    step->chi_square = dot(n, low->weighted, low->error);
    for (size_t c = 0; c < order; c++) {
        const double amplitude = low->prior[c] * low->v[c] / low->at_step.scale[c];
        step->chi_square += amplitude * amplitude;
    }
    for (size_t i = 0; i < N_LOADS; i++) {
        double rest = low->of_residual[order + i]; /* X_t' W r, then X_t' W e */
        for (size_t c = 0; c < order; c++) {
            rest -= low->gram[c * width + order + i] * low->of_residual[c];
        }
        step->loads[i] = form->fixed_load[i] + s * form->load_of_mean[i]
                       + (dot(order, low->load_at + i * order, low->v) + s * s * rest);
    }
    set_limit_ratio(scaled, add_errors(scaled));
}

/* A P_ii of the size of rounding means that no other gauge checks this one. */
static int is_checked(const Scaled *scaled, size_t gauge, double precision) {
    const LowRank *low = &scaled->low;
    return precision > scaled->map->min_information / (low->noise[gauge] + low->common);
}

void low_rank_residuals(Scaled *scaled, double *z) {
    LowRank *low = &scaled->low;
    const MaskedMap *m = scaled->step.masked;
    const size_t n = scaled->map->n_gauges;
    CHOSEN(scaled->wide, interpolate)(n, n, low->at->precision, low->part, low->sized);
    for (size_t k = 0; k < m->n_used; k++) {
        const size_t i = m->used[k];
        z[i] = is_checked(scaled, i, low->sized[i]) ? low->weighted[i] / sqrt(low->sized[i]) : 0.0;
    }
}

double low_rank_gain(Scaled *scaled, size_t k, double *gain) {
    LowRank *low = &scaled->low;
    const ScaledStep *step = &scaled->step;
    const size_t n = scaled->map->n_gauges, order = low->order;
    double *x = low->v;
    memcpy(x, low->solved + k * order, order * sizeof *x);
    solve_upper(scaled->wide, order, low->at_step.triangle, 1, x);
    for (size_t c = 0; c < order; c++) {
        x[c] *= low->at_step.product[c];
    }
    for (size_t g = 0; g < n; g++) {
        const double *row = low->row + g * low->width;
        gain[g] = low->weight[g] * (dot(order, row, x) + step->ratio * step->ratio * row[order + k]);
    }
    return step->per_pressure[k];
}

/* A at a ratio of 1 for a set of gauges, which scaled->step does not need. 0 where it has no root. */
static int set_nominal(Scaled *scaled, const unsigned char *mask) {
    LowRank *low = &scaled->low;
    low->grouped = 0;
    set_weight(scaled, mask, 1.0, low->nominal_weight);
    CHOSEN(scaled->wide, set_gram)(scaled->map->n_gauges, low->width, low->row, low->nominal_weight, low->nominal_gram);
    return set_information(scaled, 1.0, low->nominal_gram, &low->nominal);
}

/* The root of the information on the free states, in their own units, by rows. */
static void free_root(const Scaled *scaled, double *root) {
    const LowRank *low = &scaled->low;
    const size_t n_free = scaled->map->form.n_free, order = low->order, first = order - n_free;
    for (size_t i = 0; i < n_free; i++) {
        for (size_t j = 0; j < n_free; j++) {
            const double element = low->nominal.triangle[(first + j) * order + first + i];
            root[i * n_free + j] = j > i ? 0.0 : low->nominal.scale[first + i] * element;
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
        set_precision(scaled, low->nominal_weight, &low->nominal, low->nominal_along, low->nominal_precision);
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
