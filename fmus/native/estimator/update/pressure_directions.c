#include "pressure_directions.h"

#include <math.h>
#include <string.h>

#include "../numerics/lower_triangles.h"
#include "../numerics/orthogonal_rows.h"
#include "../numerics/triangles.h"

/* [L^-1 A, L^-1 N, L^-1] by columns, A the free states; the rows below the free states'; then scratch of a
   triangle that is not needed, and of orthogonal_rows.h. */
size_t pressure_directions_doubles(const Map *map) {
    const size_t n = map->n_gauges;
    return n * (map->form.n_free + 2 * n) + 2 * n * n + n * (n + 1) + 2 * N_LOADS * n + orthogonal_rows_doubles(n, 2 * n);
}

static void whiten(size_t n, const double *inverse, const double *x, size_t stride, double *out) {
    for (size_t j = 0; j < n; j++) {
        out[j] = x[j * stride];
    }
    for (size_t i = n; i-- > 0;) {
        out[i] = dot(i + 1, inverse + triangle_column(i), out);
    }
}

/* Columns of the spread that are reflected to a triangle: where they are fewer than the rows that are left, the others show
   nothing of it, to the last bit. Rows of rounding alone would be turned for long. */
static size_t reflected_columns(const Map *file) {
    return file->form.n_columns < file->n_gauges - file->form.n_free ? file->form.n_columns : 0;
}

/* Reflect the free states away: `whole` has their triangle and, in its other columns, what is left. */
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

/* Loads of the free directions, and of the columns of the spread less what the free states take of them (5, n). */
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

/* Loads of direction a, a turned row, taken out of the loads of the spread. */
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

/* The row of the largest first half that is not taken yet, marked by taking its size out. */
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

/* Of the loads that no strain shows. */
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

/* L^-1 of what is noise: the gauges' own errors, or all errors where none scales. NULL if they have no covariance. */
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
