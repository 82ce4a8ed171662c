/* What follows from the covariance of the gauges: whitening and directions of a map, made again where zero offsets
   or temperature sensors change it.

   With n gauges the covariance of the errors that do not scale is Gamma_g + added; all errors together are

       Gamma = Gamma_g + added + N N',      Gamma = L L',

   N (n, n_errors) being the errors that scale, at the nominal dynamic pressure. `added` is diag(zero_std^2) +
   zero_common_std^2 1 1' (prepared.c); where temperature sensors are known, thermal.c hands over Gamma_g (`own`) and
   Gamma (`whole`) itself. The parts make, in this order:

       ROOT                 L^-1, noise_whitening
       DIRECTIONS .. LOADS  V, S, F, R of eq:scaled-decomposition; smallest P_ii that counts
       FIXED_LOADS          gain and what it leaves, of form "absolute"

   docs/explanation/dynamic_pressure.md; strainfmu/estimator/reference/update.py, prepare, is the same by an SVD.

   Parts take about WORK multiplications of renewal.c each, so that a step has a bounded time. The map keeps its
   matrices until the last part is done: `set` has room for two. */

#include "update.h"

#include <math.h>
#include <string.h>

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
   and gives the same bits on every platform (triangles.c). docs/explanation/dynamic_pressure.md, "Weights at
   any dynamic pressure"; prepare in strainfmu/estimator/reference/update.py. */

/* The scratch `large`: L at first; then [L^-1 A, L^-1 N, L^-1] by columns; the rows [K, Q_2' L^-1] below the free states;
   two triangles of a root that is not kept; rows of all loads, twice; scratch of orthogonal_rows. */
static size_t pressure_directions_doubles(const Map *map, size_t loads) {
    const size_t n = map->n_gauges;
    return n * (map->form.n_free + 2 * n) + 2 * n * n + n * (n + 1) + 2 * loads * n + orthogonal_rows_doubles(n, 2 * n);
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

/* The covariance of the gauges' own errors in entry k. */
static double own_covariance(const AddedNoise *noise, size_t k) {
    return (noise->own != NULL ? noise->own : noise->file.gauge_covariance)[k] + noise->added[k];
}

/* Loads are the five, then those in addition. */
static size_t n_loads(const AddedNoise *noise) {
    return N_LOADS + noise->other_loads->map.n_loads;
}

/* Load k in row c of what the file has for the five (rows, 5), and for the others (rows, n_loads - 5). */
static double load_in(const AddedNoise *noise, const double *five, const double *others, size_t c, size_t k) {
    return k < N_LOADS ? five[c * N_LOADS + k] : others[c * (n_loads(noise) - N_LOADS) + k - N_LOADS];
}

/* Parts of the scratch `large`: orthogonal_rows has what is left of it. */
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
    parts.of_spread = parts.of_free + n_loads(noise) * n;
    parts.scratch = parts.of_spread + n_loads(noise) * n;
    return parts;
}

/* F_free = M T^-1, and M_N - F_free Z in of_spread (n_loads, n). */
static void split_loads(const AddedNoise *noise, const Parts *parts) {
    const Map *file = &noise->file;
    const size_t n = file->n_gauges, n_free = file->form.n_free, count = n_loads(noise);
    const OtherLoadsMap *others = &noise->other_loads->map;
    for (size_t i = 0; i < count; i++) {
        double *row = parts->of_free + i * n;
        for (size_t c = 0; c < n_free; c++) {
            row[c] = load_in(noise, file->load_per_state, others->load_per_state, c, i);
        }
        solve_transposed(n, n_free, parts->whole, row);
        for (size_t c = 0; c < n; c++) {
            parts->of_spread[i * n + c] = load_in(noise, file->form.spread_load, others->spread_load, c, i)
                                        - dot(n_free, row, parts->whole + (n_free + c) * n);
        }
        for (size_t c = 0; c < n_free; c++) {
            noise->made->load[count * c + i] = row[c];
        }
    }
}

/* F_a, and what it leaves of the loads of N. `unit` makes the row E_a of unit length; a row of zeros has no load. */
static void take_direction(const AddedNoise *noise, double *of_spread, size_t a, double unit, const double *row) {
    const size_t n = noise->file.n_gauges, count = n_loads(noise);
    for (size_t i = 0; i < count; i++) {
        double *loads = of_spread + i * n;
        const double along = unit * dot(n, loads, row);
        noise->made->load[count * a + i] = along;
        for (size_t j = 0; j < n; j++) {
            loads[j] -= along * unit * row[j];
        }
    }
}

/* The next direction, falling by size, of the turned rows; its loads. */
static void set_direction(AddedNoise *noise, const Parts *parts) {
    const size_t n = noise->file.n_gauges, a = noise->taken;
    double *square = noise->head;
    const size_t k = next_row(n - noise->file.form.n_free, square);
    const double *row = parts->rows + k * 2 * n;
    /* A row is [S_a E_a, V_a]: its first half has the length S_a, its second half is the direction itself. */
    const double root = sqrt(square[k]), unit = root > 0.0 ? 1.0 / root : 1.0;
    square[k] = -1.0;
    noise->made->singular[a] = root;
    for (size_t j = 0; j < n; j++) {
        noise->made->whitening[j * n + a] = row[n + j];
    }
    take_direction(noise, parts->of_spread, a, unit, row);
    noise->taken++;
}

/* R: the covariance that the file states, and the loads that no direction has taken. */
static void set_unseen(const AddedNoise *noise, const double *of_spread) {
    const Map *file = &noise->file;
    const size_t n = file->n_gauges;
    for (size_t k = N_LOADS; k < n_loads(noise); k++) {
        const double *left = of_spread + k * n;
        noise->made->other_unseen[k - N_LOADS] = noise->other_loads->map.spread_unseen[k - N_LOADS] + dot(n, left, left);
    }
    for (size_t i = 0; i < N_LOADS; i++) {
        for (size_t j = 0; j < N_LOADS; j++) {
            noise->made->unseen[i * N_LOADS + j] =
                file->form.spread_unseen[i * N_LOADS + j] + dot(n, of_spread + i * n, of_spread + j * n);
        }
    }
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

/* Part by part. The first one returns 0 if the covariance of the gauges is none; the others 1 where they have come to their
   ends, by parts of about `work` multiplications. */
static int pressure_directions_begin(AddedNoise *noise) {
    const Map *file = &noise->file;
    const size_t n = file->n_gauges, n_free = file->form.n_free;
    const Parts parts = parts_of(noise);
    for (size_t i = 0; i < n; i++) {
        noise->made->min_precision[i] = file->min_information / own_covariance(noise, i * n + i);
    }
    const double *inverse = errors_whitening(noise, &parts);
    if (inverse == NULL) {
        return 0;
    }
    eliminate_free(noise, inverse, parts.whole);
    split_loads(noise, &parts);
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

static int pressure_directions_turn(AddedNoise *noise, size_t work) {
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

static int pressure_directions_take(AddedNoise *noise, size_t work) {
    const size_t n = noise->file.n_gauges;
    const Parts parts = parts_of(noise);
    for (size_t done = 0; noise->taken < n && done < work; done += 2 * n * (n_loads(noise) + 1)) {
        set_direction(noise, &parts);
    }
    if (noise->taken < n) {
        return 0;
    }
    set_unseen(noise, parts.of_spread);
    return 1;
}

/* Loads by direction of a map in form "absolute": the gain of its regularisation gamma, and what noise and prior
   leave of the loads.

   Strain and loads are d - m = A q + e and f - f_mean = M q + g. The loads g that no state has go with the errors of
   strain: with N (n, n_errors) the strain of the errors and N_f (5, n_errors) their loads,

       X = cov(e, g) = N N_f',     cov e = Gamma = Gamma_g + N N',     cov g = N_f N_f'.

   The decomposition above gives directions V with V Gamma V' = 1, signal S_a of the states and loads G_a by states. In
   direction a the noise has the load b_a = (X' V')_a, and a state of prior variance 1 / gamma the gain

       k_a = u_a S_a G_a / gamma + u_a b_a,     u_a = 1 / (1 + S_a^2 / gamma),

   G_a itself for a free state, b_a where no state is seen. Under the truth (prior variance 1) the error of the loads
   is, direction by direction, k_a - b_a times the noise and G_a - k_a S_a times the state; both are kept, since the
   covariance is the sum of their squares (Joseph's form). Independent of all strain remains

       cov g - X' Gamma^-1 X = (N_f - B N)(N_f - B N)' + B Gamma_g B',     B = X' Gamma^-1,

   a sum of squares, which loses no digits to cancellation: it joins R. docs/explanation/theory.md, "Case 2"
   (eq:svd-solution) and "What a sigma is made of"; strainfmu/estimator/reference/update.py, condition and joseph. */

/* X' (5, n_gauges). */
static void set_cross(const AddedNoise *noise, double *cross) {
    const Map *file = &noise->file;
    const size_t n = file->n_gauges;
    memset(cross, 0, N_LOADS * n * sizeof *cross);
    for (size_t k = 0; k < file->n_errors; k++) {
        for (size_t i = 0; i < N_LOADS; i++) {
            const double load = file->error_load[k * N_LOADS + i];
            for (size_t j = 0; j < n; j++) {
                cross[i * n + j] += file->error_strain[k * n + j] * load;
            }
        }
    }
}

/* k_a, k_a - b_a and G_a - k_a S_a of direction a. */
static void split_direction(AddedNoise *noise, size_t a, const double *of_noise) {
    const Map *file = &noise->file;
    const double size = noise->made->singular[a], gamma = file->known_prior ? file->regularisation : 1.0;
    const double unresolved = 1.0 / (1.0 + size * size / gamma), weight = size / gamma * unresolved;
    double *load = noise->made->load + N_LOADS * a;
    for (size_t i = 0; i < N_LOADS; i++) {
        const int is_free = a < file->form.n_free;
        const double of_states = load[i];
        load[i] = is_free ? of_states : weight * of_states + unresolved * of_noise[i];
        noise->made->noise_left[N_LOADS * a + i] = load[i] - of_noise[i];
        noise->made->prior_left[N_LOADS * a + i] = is_free ? 0.0 : of_states - load[i] * size;
    }
}

/* Add cov g - X' Gamma^-1 X to R, as the two squares above. */
static void add_remainder(AddedNoise *noise, const double *by_strain) {
    const Map *file = &noise->file;
    const size_t n = file->n_gauges;
    double *unseen = noise->made->unseen;
    for (size_t k = 0; k < file->n_errors; k++) {
        double left[N_LOADS];
        for (size_t i = 0; i < N_LOADS; i++) {
            left[i] = file->error_load[k * N_LOADS + i] - dot(n, by_strain + i * n, file->error_strain + k * n);
        }
        for (size_t i = 0; i < N_LOADS * N_LOADS; i++) {
            unseen[i] += left[i / N_LOADS] * left[i % N_LOADS];
        }
    }
    for (size_t j = 0; j < n; j++) {
        double of_own[N_LOADS] = {0.0};
        for (size_t k = 0; k < n; k++) {
            const double own = own_covariance(noise, j * n + k);
            for (size_t i = 0; i < N_LOADS; i++) {
                of_own[i] += own * by_strain[i * n + k];
            }
        }
        for (size_t i = 0; i < N_LOADS * N_LOADS; i++) {
            unseen[i] += by_strain[(i / N_LOADS) * n + j] * of_own[i % N_LOADS];
        }
    }
}

/* Of the directions and their loads by states, as they are above: made->load becomes the gain,
   made->noise_left and made->prior_left what the noise and the prior leave, and made->unseen takes up what no strain shows
   of the loads that go with the noise. */
static void fixed_loads(AddedNoise *noise) {
    const size_t n = noise->file.n_gauges;
    const double *whitening = noise->made->whitening;
    double *cross = noise->rows, *by_strain = noise->rows + N_LOADS * n;
    set_cross(noise, cross);
    memset(by_strain, 0, N_LOADS * n * sizeof *by_strain);
    for (size_t a = 0; a < n; a++) {
        double of_noise[N_LOADS] = {0.0};
        for (size_t i = 0; i < N_LOADS; i++) {
            for (size_t j = 0; j < n; j++) {
                of_noise[i] += cross[i * n + j] * whitening[j * n + a];
            }
            for (size_t j = 0; j < n; j++) {
                by_strain[i * n + j] += of_noise[i] * whitening[j * n + a];
            }
        }
        /* b_a = (X' V')_a, and B = X' Gamma^-1 = X' V' V, a direction at a time. */
        split_direction(noise, a, of_noise);
    }
    add_remainder(noise, by_strain);
}

/* The parts in their order; the last two are ends. */
enum { ROOT, DIRECTIONS, TURNS, LOADS_OF_DIRECTIONS, FIXED_LOADS, MADE, NO_COVARIANCE };

static void matrices_arrays(const Map *map, size_t loads, NoiseMatrices *set, Room *room) {
    const size_t n = map->n_gauges, triangle = n * (n + 1) / 2;
    set->noise_whitening = taken(room, triangle);
    set->whitening = taken(room, n * n);
    TAKE(room, n, &set->singular, &set->min_precision);
    set->load = taken(room, loads * n);
    TAKE(room, N_LOADS * n, &set->noise_left, &set->prior_left);
    set->unseen = taken(room, N_LOADS * N_LOADS);
    set->other_unseen = taken(room, loads - N_LOADS);
}

void added_noise_arrays(const Map *map, AddedNoise *noise, Room *room) {
    const size_t n = map->n_gauges;
    noise->file = *map;
    noise->made = noise->set;
    if (map->has_low_rank) {
        return; /* low_rank.c has all */
    }
    for (size_t k = 0; k < 2; k++) {
        matrices_arrays(map, n_loads(noise), &noise->set[k], room);
    }
    noise->added = taken(room, n * n);
    noise->large = taken(room, pressure_directions_doubles(map, n_loads(noise)));
    noise->head = taken(room, 2 * n);
    noise->square = taken(room, n * n);
    noise->rows = taken(room, 2 * N_LOADS * n); /* X' and B */
}

/* Gamma and the inverse of its root L. Only the lower triangle is filled in, which is all that the root reads. 0
   where Gamma is not positive definite. */
static int set_root(AddedNoise *noise) {
    const Map *file = &noise->file;
    const size_t n = file->n_gauges;
    for (size_t k = 0; k < n * n; k++) {
        noise->square[k] = noise->whole != NULL ? noise->whole[k] + noise->added[k] : own_covariance(noise, k);
    }
    for (size_t c = 0; noise->whole == NULL && c < file->n_errors; c++) {
        const double *column = file->error_strain + c * n;
        for (size_t i = 0; i < n; i++) {
            double *restrict row = noise->square + i * n;
            for (size_t j = 0; j <= i; j++) {
                row[j] += column[i] * column[j];
            }
        }
    }
    return lower_root(n, noise->square, noise->large, noise->made->noise_whitening);
}

void added_noise_begin(AddedNoise *noise) {
    noise->stage = noise->file.has_low_rank ? MADE : ROOT;
    noise->refused = 0;
}

/* A sum that is no covariance comes from standard deviations that cancel or overflow: the file's own is used, and if
   that is none either, there is nothing to make. */
static void refuse(AddedNoise *noise) {
    const size_t n = noise->file.n_gauges;
    noise->stage = noise->refused ? NO_COVARIANCE : ROOT;
    noise->refused = 1;
    noise->own = noise->whole = NULL;
    memset(noise->added, 0, n * n * sizeof *noise->added);
}

int added_noise_part(AddedNoise *noise, size_t work) {
    int good = 1, done = 1;
    if (noise->stage >= MADE) {
        return 1;
    }
    switch (noise->stage) {
    case ROOT:
        good = set_root(noise);
        break;
    case DIRECTIONS:
        good = pressure_directions_begin(noise);
        break;
    case TURNS:
        done = pressure_directions_turn(noise, work);
        break;
    case LOADS_OF_DIRECTIONS:
        done = pressure_directions_take(noise, work);
        break;
    default:
        fixed_loads(noise);
    }
    if (!good) {
        refuse(noise);
    } else if (done) {
        const int last = noise->file.form.follows_pressure ? LOADS_OF_DIRECTIONS : FIXED_LOADS;
        noise->stage = noise->stage == last ? MADE : noise->stage + 1;
    }
    return 0;
}

int added_noise_hand_out(AddedNoise *noise, Map *map) {
    if (noise->stage != MADE) {
        return 0;
    }
    if (map->has_low_rank) {
        return 1;
    }
    map->made = noise->made; /* no step sees a part of them */
    /* The other set is free for the next matrices. */
    noise->made = noise->made == noise->set ? noise->set + 1 : noise->set;
    return !noise->refused;
}
