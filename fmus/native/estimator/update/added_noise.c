#include "added_noise.h"

#include <math.h>
#include <string.h>

#include "../numerics/arrays.h"
#include "../numerics/lower_triangles.h"
#include "../numerics/triangles.h"
#include "pressure_directions.h"

/* The scratch `large` holds [sqrt(gamma) I, 0; L^-1 A, L^-1], of order n_states + n_gauges by columns, or what
   pressure_directions.c needs. */
static size_t large_doubles(const Map *map) {
    const size_t order = map->n_states + map->n_gauges, directions = pressure_directions_doubles(map);
    return order * order > directions ? order * order : directions;
}

size_t added_noise_doubles(const Map *map) {
    const size_t n = map->n_gauges, triangle = n * (n + 1) / 2, loads = N_LOADS;
    const size_t of_form = map->scaled ? n * n + 2 * n + loads * n + loads * loads : 0;
    return n * n + 4 * triangle + 2 * loads * n + 2 * loads * loads + n + of_form + large_doubles(map)
         + 2 * (map->n_states + n) + 3 * n * n + n + loads * (n + map->n_states);
}

void added_noise_arrays(const Map *map, AddedNoise *noise, double **doubles) {
    const size_t n = map->n_gauges, triangle = n * (n + 1) / 2;
    noise->file = *map;
    noise->added = taken(doubles, n * n);
    noise->residual_triangle = taken(doubles, triangle);
    noise->gain_triangle = taken(doubles, triangle);
    noise->noise_whitening = taken(doubles, triangle);
    noise->noise_root = taken(doubles, triangle);
    noise->load_gain = taken(doubles, N_LOADS * n);
    noise->regression = taken(doubles, N_LOADS * n);
    noise->load_covariance = taken(doubles, N_LOADS * N_LOADS);
    noise->remainder = taken(doubles, N_LOADS * N_LOADS);
    noise->min_precision = taken(doubles, n);
    if (map->scaled) {
        noise->whitening = taken(doubles, n * n);
        noise->singular = taken(doubles, n);
        noise->form_min_precision = taken(doubles, n);
        noise->load = taken(doubles, N_LOADS * n);
        noise->unseen = taken(doubles, N_LOADS * N_LOADS);
    }
    noise->large = taken(doubles, large_doubles(map));
    noise->head = taken(doubles, 2 * (map->n_states + n));
    for (size_t k = 0; k < 3; k++) {
        noise->square[k] = taken(doubles, n * n);
    }
    noise->rows = taken(doubles, n + N_LOADS * (n + map->n_states));
}

/* B = X' Gamma^-1 (5, n_gauges), loads that no state holds per strain that none holds. */
static void set_by_strain(const AddedNoise *noise, double *by_strain) {
    const size_t n = noise->file.n_gauges;
    for (size_t i = 0; i < N_LOADS; i++) {
        for (size_t j = 0; j < n; j++) {
            double sum = 0.0;
            for (size_t k = j; k < n; k++) {
                sum += noise->regression[i * n + k] * noise->noise_whitening[triangle_column(k) + j];
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
    memset(noise->remainder, 0, N_LOADS * N_LOADS * sizeof *noise->remainder);
    for (size_t i = 0; i < N_LOADS; i++) {
        memset(cross, 0, n * sizeof *cross);
        for (size_t k = 0; k < file->n_errors; k++) {
            for (size_t j = 0; j < n; j++) {
                cross[j] += file->error_strain[k * n + j] * file->error_load[k * N_LOADS + i];
            }
        }
        for (size_t j = 0; j < n; j++) {
            noise->regression[i * n + j] = dot(j + 1, noise->noise_whitening + triangle_column(j), cross);
        }
    }
    set_by_strain(noise, by_strain);
    for (size_t k = 0; k < file->n_errors; k++) {
        double left[N_LOADS];
        for (size_t i = 0; i < N_LOADS; i++) {
            left[i] = file->error_load[k * N_LOADS + i] - dot(n, by_strain + i * n, file->error_strain + k * n);
        }
        for (size_t i = 0; i < N_LOADS * N_LOADS; i++) {
            noise->remainder[i] += left[i / N_LOADS] * left[i % N_LOADS];
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
            noise->remainder[i] += by_strain[(i / N_LOADS) * n + j] * of_own[i % N_LOADS];
        }
    }
}

/* Householder's reflections of [sqrt(gamma) I; L^-1 A] on [0; L^-1]: then the upper rows of the latter are Q_1' of it
   and the lower ones its complement, W, of which square[0] takes the R. */
static void set_complement(AddedNoise *noise, double regularisation, double *triangle) {
    const Map *file = &noise->file;
    const size_t n = file->n_gauges, states = file->n_states, order = n + states;
    double *a = noise->large;
    memset(a, 0, order * order * sizeof *a);
    for (size_t c = 0; c < states; c++) {
        a[c * order + c] = sqrt(regularisation);
        for (size_t i = 0; i < n; i++) {
            a[c * order + states + i] =
                dot(i + 1, noise->noise_whitening + triangle_column(i), file->state_operator + c * n);
        }
    }
    for (size_t j = 0; j < n; j++) {
        for (size_t i = j; i < n; i++) {
            a[(states + j) * order + states + i] = noise->noise_whitening[triangle_column(i) + j];
        }
    }
    householder_columns(noise->wide, order, states, order, a, noise->head);
    for (size_t j = 0; j < n; j++) {
        memcpy(noise->square[0] + j * n, a + (states + j) * order + states, n * sizeof *a);
    }
    householder_triangle(noise->wide, n, n, noise->square[0]);
    for (size_t j = 0; j < n; j++) {
        memcpy(triangle + triangle_column(j), noise->square[0] + j * n, (j + 1) * sizeof *a);
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
            noise->load_gain[N_LOADS * j + i] = dot(states, of_states + i * states, gain) + of_residual[i * n + j];
        }
    }
}

/* Matrices at the nominal dynamic pressure, which are all of form "absolute". The other form has its loads from its
   directions: these matrices tell which gauges identify the state, and which cannot be distinguished. */
static int set_matrices(AddedNoise *noise) {
    const Map *file = &noise->file;
    const size_t n = file->n_gauges;
    const double of_residual = file->known_prior ? 1.0 : 0.0;
    for (size_t k = 0; k < n * n; k++) {
        noise->square[0][k] = noise->whole != NULL ? noise->whole[k] + noise->added[k] : own_covariance(noise, k);
    }
    for (size_t c = 0; noise->whole == NULL && c < file->n_errors; c++) {
        const double *column = file->error_strain + c * n;
        for (size_t i = 0; i < n; i++) {
            double *restrict row = noise->square[0] + i * n;
            for (size_t j = 0; j < n; j++) {
                row[j] += column[i] * column[j];
            }
        }
    }
    if (!lower_root(n, noise->square[0], noise->noise_root, noise->noise_whitening)) {
        return 0;
    }
    if (!file->scaled) {
        set_remainder(noise);
    }
    set_complement(noise, of_residual, noise->residual_triangle);
    if (of_residual == file->regularisation) {
        memcpy(noise->gain_triangle, noise->residual_triangle, n * (n + 1) / 2 * sizeof *noise->gain_triangle);
    } else {
        set_complement(noise, file->regularisation, noise->gain_triangle);
    }
    if (!file->scaled) {
        set_load_gain(noise);
    }
    memset(noise->min_precision, 0, n * sizeof *noise->min_precision);
    for (size_t i = 0; i < n; i++) {
        for (size_t j = 0; j <= i; j++) {
            const double weight = noise->noise_whitening[triangle_column(i) + j];
            noise->min_precision[j] += file->min_information * (weight * weight);
        }
    }
    return 1;
}

/* The covariance of the loads with all gauges; masked is scratch. */
static void set_load_covariance(AddedNoise *noise, const Map *map, MaskedMap *masked, Workspace *work) {
    memset(masked->mask, 1, map->n_gauges);
    masked_map_prepare(map, masked, work);
    masked_load_covariance(map, masked, work);
    memcpy(noise->load_covariance, masked->load_covariance, sizeof masked->load_covariance);
}

/* Let map have the matrices. */
static void hand_out(const AddedNoise *noise, Map *map) {
    map->residual_triangle = noise->residual_triangle;
    map->gain_triangle = noise->gain_triangle;
    map->noise_whitening = noise->noise_whitening;
    map->noise_root = noise->noise_root;
    map->load_gain = noise->load_gain;
    map->load_covariance = noise->load_covariance;
    map->regression = noise->regression;
    map->remainder = noise->remainder;
    map->min_precision = noise->min_precision;
    map->form.whitening = noise->whitening;
    map->form.singular = noise->singular;
    map->form.load = noise->load;
    map->form.unseen = noise->unseen;
    map->form.min_precision = noise->form_min_precision;
}

static int apply(AddedNoise *noise, Map *map, MaskedMap *masked, Workspace *work) {
    if (!set_matrices(noise) || (map->scaled && !set_pressure_directions(noise))) {
        return 0;
    }
    hand_out(noise, map);
    if (!map->scaled) {
        set_load_covariance(noise, map, masked, work);
    }
    return 1;
}

int added_noise_apply(AddedNoise *noise, Map *map, MaskedMap *masked, Workspace *work) {
    const size_t n = noise->file.n_gauges;
    if (apply(noise, map, masked, work)) {
        return 1;
    }
    noise->own = noise->whole = NULL;
    memset(noise->added, 0, n * n * sizeof *noise->added);
    apply(noise, map, masked, work);
    return 0;
}
