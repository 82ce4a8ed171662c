/* The directions of a map that serve every dynamic pressure (eq:scaled-decomposition), for the errors that its
   gauges have now.

   n gauges, n_free free states A (n, n_free) of Case 1, N (n, n) the columns of what has a prior and scales:
   `spread`, states of Case 2 among them. L is the root of the covariance of the gauges' own errors (form
   "dynamic_pressure") or of all errors (form "absolute", where nothing scales). Householder reflections Q take the
   free states out, orthogonal transformations U of the rows below diagonalise the rest:

       Q' L^-1 [A, N, 1] = [T, Z, Q_1' L^-1; 0, K, Q_2' L^-1],      U K = diag(S) E,   E orthonormal rows

       V = [Q_1' L^-1; U Q_2' L^-1]        n directions in which noise is 1 and independent, the free states first
       S                                   signal over noise at s = 1, falling; 0 for free states

   Loads follow. With M (5, n_free) of the free states and M_N (5, n) of the columns of N,

       F_free = M T^-1,      M_N - F_free Z = loads of what the free states do not take (split_loads)
       F_a    = (M_N - F_free Z) E_a'       by the unit row E_a, which is then taken out of the rest
       R      = spread_unseen + rest rest'  covariance of loads that no strain shows

   Other loads (section loads, rolling moment) are more rows of the same. An SVD would give the same numbers; turning
   rows until they are orthogonal keeps small S to full relative accuracy, can be divided into parts of bounded time,
   and gives the same bits on every platform (orthogonal_rows.c). docs/explanation/dynamic_pressure.md, "Weights at
   any dynamic pressure"; prepare in strainfmu/estimator/reference/update.py. */

#include "pressure_directions.h"

#include <math.h>
#include <string.h>

#include "../numerics/orthogonal_rows.h"
#include "../numerics/triangles.h"

/* Scratch: [L^-1 A, L^-1 N, L^-1] by columns; the rows [K, Q_2' L^-1] below the free states; two triangles of a root
   that is not kept; loads of five rows; scratch of orthogonal_rows.h. */
size_t pressure_directions_doubles(const Map *map) {
    const size_t n = map->n_gauges;
    return n * (map->form.n_free + 2 * n) + 2 * n * n + n * (n + 1) + 2 * N_LOADS * n + orthogonal_rows_doubles(n, 2 * n);
}

/* L^-1 x of a strided vector; from the last row on, so that it is done in place. */
static void whiten(size_t n, const double *inverse, const double *x, size_t stride, double *out) {
    for (size_t j = 0; j < n; j++) {
        out[j] = x[j * stride];
    }
    for (size_t i = n; i-- > 0;) {
        out[i] = dot(i + 1, inverse + triangle_column(i), out);
    }
}

/* Columns of N that are reflected to a triangle as well. Where they are fewer than the rows below the free states,
   the remaining rows show nothing of N to the last bit; rows of rounding alone would take long to turn. */
static size_t reflected_columns(const Map *file) {
    return file->form.n_columns < file->n_gauges - file->form.n_free ? file->form.n_columns : 0;
}

/* Q' L^-1 [A, N, 1]: `whole` has T on top of its first columns, and the other columns as they are left. */
static void eliminate_free(AddedNoise *noise, const double *inverse, double *whole) {
    const Map *file = &noise->file;
    const size_t n = file->n_gauges, n_free = file->form.n_free;
    for (size_t c = 0; c < n_free; c++) {
        whiten(n, inverse, file->state_operator + c * n, 1, whole + c * n);
    }
    for (size_t c = 0; c < n; c++) {
        whiten(n, inverse, file->form.spread + c, n, whole + (n_free + c) * n);
        double *column = whole + (n_free + n + c) * n;
        for (size_t i = 0; i < n; i++) {
            column[i] = i < c ? 0.0 : inverse[triangle_column(i) + c];
        }
    }
    householder_columns(noise->wide, n, n_free + reflected_columns(file), n_free + 2 * n, whole, noise->head);
}

/* Rows of loads, five or the other ones, that follow the directions. */
typedef struct {
    size_t count;
    const double *per_state, *spread; /* (n_states, count), (n_gauges, count) */
    double *of_free, *of_spread;      /* (count, n_gauges) scratch */
    double *load;                     /* (n_gauges, count) of the directions */
} LoadRows;

/* F_free = M T^-1, and M_N - F_free Z in of_spread (count, n). */
static void split_loads(const Map *file, const double *whole, const LoadRows *rows) {
    const size_t n = file->n_gauges, n_free = file->form.n_free, count = rows->count;
    for (size_t i = 0; i < count; i++) {
        double *row = rows->of_free + i * n;
        for (size_t c = 0; c < n_free; c++) {
            row[c] = rows->per_state[count * c + i];
        }
        solve_transposed(n, n_free, whole, row);
        for (size_t c = 0; c < n; c++) {
            rows->of_spread[i * n + c] = rows->spread[count * c + i] - dot(n_free, row, whole + (n_free + c) * n);
        }
        for (size_t c = 0; c < n_free; c++) {
            rows->load[count * c + i] = row[c];
        }
    }
}

/* F_a, and what it leaves of the loads of N. `unit` makes the row E_a of unit length; a row of zeros has no load. */
static void take_direction(const LoadRows *rows, size_t n, size_t a, double unit, const double *row) {
    for (size_t i = 0; i < rows->count; i++) {
        double *loads = rows->of_spread + i * n;
        const double along = unit * dot(n, loads, row);
        rows->load[rows->count * a + i] = along;
        for (size_t j = 0; j < n; j++) {
            loads[j] -= along * unit * row[j];
        }
    }
}

/* The row of largest S that is not taken yet; square[] of a taken row is -1. */
static size_t next_row(size_t count, double *square) {
    size_t best = 0;
    for (size_t k = 1; k < count; k++) {
        best = square[k] > square[best] ? k : best;
    }
    return best;
}

/* The next direction, falling by size, of the turned rows; its loads. */
static void set_direction(AddedNoise *noise, const double *rows, const LoadRows *five, const LoadRows *other_loads) {
    const size_t n = noise->file.n_gauges, a = noise->taken;
    double *square = noise->head;
    const size_t k = next_row(n - noise->file.form.n_free, square);
    const double *row = rows + k * 2 * n;
    /* A row is [S_a E_a, V_a]: its first half has the length S_a, its second half is the direction itself. */
    const double root = sqrt(square[k]), unit = root > 0.0 ? 1.0 / root : 1.0;
    square[k] = -1.0;
    noise->made->singular[a] = root;
    for (size_t j = 0; j < n; j++) {
        noise->made->whitening[j * n + a] = row[n + j];
    }
    take_direction(five, n, a, unit, row);
    take_direction(other_loads, n, a, unit, row);
    noise->taken++;
}

/* R: the covariance that the file states, and the loads that no direction has taken. */
static void set_unseen(const AddedNoise *noise, const LoadRows *five, const LoadRows *other_loads) {
    const Map *file = &noise->file;
    const size_t n = file->n_gauges;
    for (size_t i = 0; i < other_loads->count; i++) {
        const double *left = other_loads->of_spread + i * n;
        noise->made->other_unseen[i] = noise->other_loads->map.spread_unseen[i] + dot(n, left, left);
    }
    for (size_t i = 0; i < N_LOADS; i++) {
        for (size_t j = 0; j < N_LOADS; j++) {
            noise->made->unseen[i * N_LOADS + j] =
                file->form.spread_unseen[i * N_LOADS + j] + dot(n, five->of_spread + i * n, five->of_spread + j * n);
        }
    }
}

/* Parts of the scratch `large`: orthogonal_rows.h has what is left of it. */
typedef struct {
    double *whole, *rows, *root, *inverse, *of_free, *of_spread, *scratch;
} Parts;

static Parts parts_of(const AddedNoise *noise) {
    const size_t n = noise->file.n_gauges, n_free = noise->file.form.n_free, triangle = n * (n + 1) / 2;
    Parts parts = {.whole = noise->large};
    parts.rows = parts.whole + n * (n_free + 2 * n);
    parts.root = parts.rows + 2 * n * n;
    parts.inverse = parts.root + triangle;
    parts.of_free = parts.inverse + triangle;
    parts.of_spread = parts.of_free + N_LOADS * n;
    parts.scratch = parts.of_spread + N_LOADS * n;
    return parts;
}

static LoadRows five_rows(const AddedNoise *noise, const Parts *parts) {
    const Map *file = &noise->file;
    return (LoadRows){N_LOADS,        file->load_per_state, file->form.spread_load,
                      parts->of_free, parts->of_spread,     noise->made->load};
}

/* Of none for a map without. */
static LoadRows other_rows(const AddedNoise *noise) {
    const OtherLoads *other_loads = noise->other_loads;
    if (other_loads == NULL) {
        return (LoadRows){0};
    }
    const OtherLoadsMap *map = &other_loads->map;
    return (LoadRows){map->n_loads,      map->load_per_state, map->spread_load, other_loads->rows,
                      other_loads->rows + map->n_loads * noise->file.n_gauges, noise->made->other_load};
}

/* L^-1 of the errors that do not scale; NULL where they have no covariance. */
static const double *errors_whitening(AddedNoise *noise, const Parts *parts) {
    const size_t n = noise->file.n_gauges;
    if (!noise->file.form.follows_pressure) {
        return noise->made->noise_whitening;
    }
    for (size_t k = 0; k < n * n; k++) {
        noise->square[k] = own_covariance(noise, k);
    }
    return lower_root(n, noise->square, parts->root, parts->inverse) ? parts->inverse : NULL;
}

int pressure_directions_begin(AddedNoise *noise) {
    const Map *file = &noise->file;
    const size_t n = file->n_gauges, n_free = file->form.n_free;
    const Parts parts = parts_of(noise);
    const LoadRows five = five_rows(noise, &parts), other_loads = other_rows(noise);
    for (size_t i = 0; i < n; i++) {
        noise->made->form_min_precision[i] = file->min_information / own_covariance(noise, i * n + i);
    }
    const double *inverse = errors_whitening(noise, &parts);
    if (inverse == NULL) {
        return 0;
    }
    eliminate_free(noise, inverse, parts.whole);
    split_loads(file, parts.whole, &five);
    split_loads(file, parts.whole, &other_loads);
    for (size_t a = 0; a < n_free; a++) {
        noise->made->singular[a] = 0.0;
        for (size_t j = 0; j < n; j++) {
            noise->made->whitening[j * n + a] = parts.whole[(n_free + n + j) * n + a];
        }
    }
    for (size_t k = 0; k < n - n_free; k++) {
        for (size_t c = 0; c < 2 * n; c++) {
            /* Below the diagonal stand Householder vectors, which are not part of the matrix. */
            const int is_below = c < k && c < reflected_columns(file);
            parts.rows[k * 2 * n + c] = is_below ? 0.0 : parts.whole[(n_free + c) * n + n_free + k];
        }
    }
    noise->turned = (Turned){0};
    return 1;
}

int pressure_directions_turn(AddedNoise *noise, size_t work) {
    const size_t n = noise->file.n_gauges, count = n - noise->file.form.n_free;
    const Parts parts = parts_of(noise);
    if (!orthogonal_rows(noise->wide, count, n, 2 * n, parts.rows, parts.scratch, &noise->turned, work)) {
        return 0;
    }
    for (size_t k = 0; k < count; k++) {
        /* S_a^2, for the order in which directions are taken. */
        noise->head[k] = dot(n, parts.rows + k * 2 * n, parts.rows + k * 2 * n);
    }
    noise->taken = noise->file.form.n_free;
    return 1;
}

int pressure_directions_take(AddedNoise *noise, size_t work) {
    const size_t n = noise->file.n_gauges;
    const Parts parts = parts_of(noise);
    const LoadRows five = five_rows(noise, &parts), other_loads = other_rows(noise);
    for (size_t done = 0; noise->taken < n && done < work; done += 2 * n * (five.count + other_loads.count + 1)) {
        set_direction(noise, parts.rows, &five, &other_loads);
    }
    if (noise->taken < n) {
        return 0;
    }
    set_unseen(noise, &five, &other_loads);
    return 1;
}
