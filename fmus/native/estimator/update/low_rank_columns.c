/* Many gauges: the columns of their errors, once.

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
   called F from here on; their sizes are s S, 1 and s.

   docs/explanation/dynamic_pressure.md, "Many gauges"; low_rank_points.c goes on. */

#include "low_rank.h"

#include <math.h>
#include <string.h>

#define SMALLEST 1e-5 /* S of a column that is kept, over the noise of all gauges */
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
        low->interval[k].left = taken(room, LOW_NODES * N_LOADS * (N_LOADS + 1));
        low->interval[k].gain = taken(room, LOW_NODES * N_LOADS * n);
        low->interval[k].term_square = taken(room, LOW_NODES * terms * 6);
    }
    /* Of an interval, or at a ratio of 1. */
    TAKE(room, n * order, &low->along, &low->nominal_along);
    TAKE(room, n, &low->nominal_weight, &low->nominal_precision, &low->sized, &low->vector);
    low->gram = taken(room, width * width);
    TAKE(room, order * order, &low->triangle, &low->inverse, &low->square);
    TAKE(room, order, &low->product, &low->scale, &low->ones);
    low->rows = taken(room, LANES * order);
    low->of_term = taken(room, terms * order);
    TAKE(room, in_lanes(n_free) * in_lanes(n_free), &low->free, &low->ratio);
    TAKE(room, triangle_column(order), &low->of_all, &low->of_set);
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
        const size_t best = next_row(rows, low->scratch);
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
    memset(low->all_gauges, 1, map->n_gauges);
    low->all_identify = low_rank_nominal_covariance(scaled, low->all_gauges, 0, low->of_all);
    scaled->step.masked = NULL;
}
