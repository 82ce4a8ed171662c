#include "added_noise.h"

#include <math.h>
#include <string.h>

#include "../numerics/arrays.h"
#include "../numerics/lower_triangles.h"
#include "../numerics/triangles.h"
#include "pressure_directions.h"

/* What a part makes, in their order. */
enum { ROOT, GAINS, DIRECTIONS, TURNS, LOADS_OF_DIRECTIONS, MADE, NO_COVARIANCE };

/* The scratch `large` holds [sqrt(gamma) I, 0; L^-1 A, L^-1], of order n_states + n_gauges by columns, or what
   pressure_directions.c needs. */
static size_t large_doubles(const Map *map) {
    const size_t order = map->n_states + map->n_gauges, directions = pressure_directions_doubles(map);
    return order * order > directions ? order * order : directions;
}

static size_t n_other(const AddedNoise *noise) {
    return noise->other_loads == NULL ? 0 : noise->other_loads->map.n_loads;
}

/* Of a set of the matrices. */
static size_t matrices_doubles(const Map *map, size_t others) {
    const size_t n = map->n_gauges, triangle = n * (n + 1) / 2, loads = N_LOADS;
    const size_t of_form = map->scaled ? n * n + 2 * n + loads * n + loads * loads + n * others + others : 0;
    return 4 * triangle + 2 * loads * n + 2 * loads * loads + n + of_form;
}

size_t added_noise_doubles(const Map *map, size_t others) {
    const size_t n = map->n_gauges, loads = N_LOADS;
    return 2 * matrices_doubles(map, others) + n * n + large_doubles(map) + 2 * (map->n_states + n) + n * n + n
         + loads * (n + map->n_states);
}

static void matrices_arrays(const Map *map, size_t others, NoiseMatrices *set, double **doubles) {
    const size_t n = map->n_gauges, triangle = n * (n + 1) / 2;
    set->residual_triangle = taken(doubles, triangle);
    set->gain_triangle = taken(doubles, triangle);
    set->noise_whitening = taken(doubles, triangle);
    set->noise_root = taken(doubles, triangle);
    set->load_gain = taken(doubles, N_LOADS * n);
    set->regression = taken(doubles, N_LOADS * n);
    set->load_covariance = taken(doubles, N_LOADS * N_LOADS);
    set->remainder = taken(doubles, N_LOADS * N_LOADS);
    set->min_precision = taken(doubles, n);
    if (map->scaled) {
        set->whitening = taken(doubles, n * n);
        set->singular = taken(doubles, n);
        set->form_min_precision = taken(doubles, n);
        set->load = taken(doubles, N_LOADS * n);
        set->unseen = taken(doubles, N_LOADS * N_LOADS);
        set->other_load = taken(doubles, n * others);
        set->other_unseen = taken(doubles, others);
    }
}

void added_noise_arrays(const Map *map, AddedNoise *noise, double **doubles) {
    const size_t n = map->n_gauges;
    noise->file = *map;
    noise->made = noise->set;
    for (size_t k = 0; k < 2; k++) {
        matrices_arrays(map, n_other(noise), &noise->set[k], doubles);
    }
    noise->added = taken(doubles, n * n);
    noise->large = taken(doubles, large_doubles(map));
    noise->head = taken(doubles, 2 * (map->n_states + n));
    noise->square = taken(doubles, n * n);
    noise->rows = taken(doubles, n + N_LOADS * (n + map->n_states));
}

/* B = X' Gamma^-1 (5, n_gauges), loads that no state holds per strain that none holds. */
static void set_by_strain(const AddedNoise *noise, double *by_strain) {
    const size_t n = noise->file.n_gauges;
    for (size_t i = 0; i < N_LOADS; i++) {
        for (size_t j = 0; j < n; j++) {
            double sum = 0.0;
            for (size_t k = j; k < n; k++) {
                sum += noise->made->regression[i * n + k] * noise->made->noise_whitening[triangle_column(k) + j];
            }
            by_strain[i * n + j] = sum;
        }
    }
}

/* The covariance of the gauges' own errors in entry k. */
static double own_covariance(const AddedNoise *noise, size_t k) {
    return (noise->own != NULL ? noise->own : noise->file.gauge_covariance)[k] + noise->added[k];
}

/* L'^-1 X with X = N N_f', and S = (N_f - B N) (N_f - B N)' + B Gamma_g B' with B = X' Gamma^-1: the loads that no state
   holds, and what strain does not show of them. */
static void set_remainder(AddedNoise *noise) {
    const Map *file = &noise->file;
    const size_t n = file->n_gauges;
    double *cross = noise->rows, *by_strain = noise->rows + n;
    memset(noise->made->remainder, 0, N_LOADS * N_LOADS * sizeof *noise->made->remainder);
    for (size_t i = 0; i < N_LOADS; i++) {
        memset(cross, 0, n * sizeof *cross);
        for (size_t k = 0; k < file->n_errors; k++) {
            for (size_t j = 0; j < n; j++) {
                cross[j] += file->error_strain[k * n + j] * file->error_load[k * N_LOADS + i];
            }
        }
        for (size_t j = 0; j < n; j++) {
            noise->made->regression[i * n + j] = dot(j + 1, noise->made->noise_whitening + triangle_column(j), cross);
        }
    }
    set_by_strain(noise, by_strain);
    for (size_t k = 0; k < file->n_errors; k++) {
        double left[N_LOADS];
        for (size_t i = 0; i < N_LOADS; i++) {
            left[i] = file->error_load[k * N_LOADS + i] - dot(n, by_strain + i * n, file->error_strain + k * n);
        }
        for (size_t i = 0; i < N_LOADS * N_LOADS; i++) {
            noise->made->remainder[i] += left[i / N_LOADS] * left[i % N_LOADS];
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
            noise->made->remainder[i] += by_strain[(i / N_LOADS) * n + j] * of_own[i % N_LOADS];
        }
    }
}

/* Householder's reflections of [sqrt(gamma) I; L^-1 A] on [0; L^-1]: then the upper rows of the latter are Q_1' of it
   and the lower ones its complement, W, of which square takes the R. */
static void set_complement(AddedNoise *noise, double regularisation, double *triangle) {
    const Map *file = &noise->file;
    const size_t n = file->n_gauges, states = file->n_states, order = n + states;
    double *a = noise->large;
    memset(a, 0, order * order * sizeof *a);
    for (size_t c = 0; c < states; c++) {
        a[c * order + c] = sqrt(regularisation);
        for (size_t i = 0; i < n; i++) {
            a[c * order + states + i] =
                dot(i + 1, noise->made->noise_whitening + triangle_column(i), file->state_operator + c * n);
        }
    }
    for (size_t j = 0; j < n; j++) {
        for (size_t i = j; i < n; i++) {
            a[(states + j) * order + states + i] = noise->made->noise_whitening[triangle_column(i) + j];
        }
    }
    householder_columns(noise->wide, order, states, order, a, noise->head);
    for (size_t j = 0; j < n; j++) {
        memcpy(noise->square + j * n, a + (states + j) * order + states, n * sizeof *a);
    }
    householder_triangle(noise->wide, n, n, noise->square);
    for (size_t j = 0; j < n; j++) {
        memcpy(triangle + triangle_column(j), noise->square + j * n, (j + 1) * sizeof *a);
    }
}

/* G = (M - X' Gamma^-1 A) T + X' Gamma^-1, T = R^-1 Q_1' [0; L^-1] from what set_complement has left. */
static void set_load_gain(AddedNoise *noise) {
    const Map *file = &noise->file;
    const size_t n = file->n_gauges, states = file->n_states, order = n + states;
    double *of_residual = noise->rows, *of_states = noise->rows + N_LOADS * n;
    set_by_strain(noise, of_residual);
    for (size_t i = 0; i < N_LOADS; i++) {
        for (size_t c = 0; c < states; c++) {
            of_states[i * states + c] =
                file->load_per_state[N_LOADS * c + i] - dot(n, of_residual + i * n, file->state_operator + c * n);
        }
    }
    for (size_t j = 0; j < n; j++) {
        double *gain = noise->large + (states + j) * order;
        solve_triangle(order, states, noise->large, gain);
        for (size_t i = 0; i < N_LOADS; i++) {
            noise->made->load_gain[N_LOADS * j + i] = dot(states, of_states + i * states, gain) + of_residual[i * n + j];
        }
    }
}

/* The covariance of the gauges at the nominal dynamic pressure; its root, and the inverse of that; of the errors the lower
   triangle, which the root reads. 0 if it is none. */
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
    return lower_root(n, noise->square, noise->made->noise_root, noise->made->noise_whitening);
}

/* The rest of the matrices at the nominal dynamic pressure, which are all of form "absolute". The other form has its loads
   from its directions: these matrices tell which gauges identify the state, and which cannot be distinguished. */
static void set_gains(AddedNoise *noise) {
    const Map *file = &noise->file;
    const size_t n = file->n_gauges;
    const double of_residual = file->known_prior ? 1.0 : 0.0;
    NoiseMatrices *made = noise->made;
    set_complement(noise, of_residual, made->residual_triangle);
    if (of_residual == file->regularisation) {
        memcpy(made->gain_triangle, made->residual_triangle, n * (n + 1) / 2 * sizeof *made->gain_triangle);
    } else {
        set_complement(noise, file->regularisation, made->gain_triangle);
    }
    if (!file->scaled) {
        set_remainder(noise);
        set_load_gain(noise);
    }
    memset(made->min_precision, 0, n * sizeof *made->min_precision);
    for (size_t i = 0; i < n; i++) {
        for (size_t j = 0; j <= i; j++) {
            const double weight = made->noise_whitening[triangle_column(i) + j];
            made->min_precision[j] += file->min_information * (weight * weight);
        }
    }
}

/* The covariance of the loads with all gauges; masked is scratch. */
static void set_load_covariance(AddedNoise *noise, const Map *map, MaskedMap *masked, Workspace *work) {
    memset(masked->mask, 1, map->n_gauges);
    masked_map_prepare(map, masked, work);
    masked_load_covariance(map, masked, work);
    memcpy(noise->made->load_covariance, masked->load_covariance, sizeof masked->load_covariance);
}

static void hand_out(const AddedNoise *noise, Map *map) {
    const NoiseMatrices *made = noise->made;
    map->residual_triangle = made->residual_triangle;
    map->gain_triangle = made->gain_triangle;
    map->noise_whitening = made->noise_whitening;
    map->noise_root = made->noise_root;
    map->load_gain = made->load_gain;
    map->load_covariance = made->load_covariance;
    map->regression = made->regression;
    map->remainder = made->remainder;
    map->min_precision = made->min_precision;
    map->form.whitening = made->whitening;
    map->form.singular = made->singular;
    map->form.load = made->load;
    map->form.unseen = made->unseen;
    map->form.min_precision = made->form_min_precision;
    if (noise->other_loads != NULL) {
        noise->other_loads->load = made->other_load;
        noise->other_loads->unseen = made->other_unseen;
    }
}

void added_noise_begin(AddedNoise *noise) {
    noise->stage = ROOT;
    noise->refused = 0;
}

/* Go back to the file's covariance; without one either, there is nothing to make. */
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
    case GAINS: /* the last of form "absolute" */
        set_gains(noise);
        break;
    case DIRECTIONS:
        good = pressure_directions_begin(noise);
        break;
    case TURNS:
        done = pressure_directions_turn(noise, work);
        break;
    default:
        done = pressure_directions_take(noise, work);
    }
    if (!good) {
        refuse(noise);
    } else if (done) {
        noise->stage = noise->stage == GAINS && !noise->file.scaled ? MADE : noise->stage + 1;
    }
    return 0;
}

int added_noise_hand_out(AddedNoise *noise, Map *map, MaskedMap *masked, Workspace *work) {
    if (noise->stage != MADE) {
        return 0;
    }
    hand_out(noise, map);
    if (!map->scaled) {
        set_load_covariance(noise, map, masked, work);
    }
    noise->made = noise->made == noise->set ? noise->set + 1 : noise->set;
    return !noise->refused;
}
