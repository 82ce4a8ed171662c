#include "added_noise.h"

#include <math.h>
#include <string.h>

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
         + 2 * (map->n_states + n) + 3 * n * n + loads * (n + map->n_states);
}

static double *taken(double **doubles, size_t count) {
    double *array = *doubles;
    *doubles += count;
    return array;
}

void added_noise_arrays(const Map *map, AddedNoise *noise, double **doubles) {
    const size_t n = map->n_gauges, triangle = n * (n + 1) / 2;
    noise->original = *map;
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
    noise->rows = taken(doubles, N_LOADS * (n + map->n_states));
}

/* L'^-1 X for the loads that no state holds, X = L (regression of the file)', and S + X' Gamma^-1 X - X' Gamma'^-1 X. */
static void set_remainder(AddedNoise *noise) {
    const Map *file = &noise->original;
    const size_t n = file->n_gauges;
    double *cross = noise->rows;
    for (size_t i = 0; i < N_LOADS; i++) {
        for (size_t j = 0; j < n; j++) {
            cross[i * n + j] = dot(j + 1, file->noise_root + triangle_column(j), file->regression + i * n);
        }
        for (size_t j = 0; j < n; j++) {
            noise->regression[i * n + j] = dot(j + 1, noise->noise_whitening + triangle_column(j), cross + i * n);
        }
    }
    for (size_t i = 0; i < N_LOADS; i++) {
        for (size_t j = 0; j < N_LOADS; j++) {
            noise->remainder[i * N_LOADS + j] =
                file->remainder[i * N_LOADS + j] + dot(n, file->regression + i * n, file->regression + j * n)
                - dot(n, noise->regression + i * n, noise->regression + j * n);
        }
    }
}

/* Householder's reflections of [sqrt(gamma) I; L^-1 A] on [0; L^-1]: then the upper rows of the latter are Q_1' of it
   and the lower ones its complement, W, of which square[0] takes the R. */
static void set_complement(AddedNoise *noise, double regularisation, double *triangle) {
    const Map *file = &noise->original;
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
    householder_columns(order, states, order, a, noise->head);
    for (size_t j = 0; j < n; j++) {
        memcpy(noise->square[0] + j * n, a + (states + j) * order + states, n * sizeof *a);
    }
    householder_triangle(n, n, noise->square[0]);
    for (size_t j = 0; j < n; j++) {
        memcpy(triangle + triangle_column(j), noise->square[0] + j * n, (j + 1) * sizeof *a);
    }
}

/* G = (M - X' Gamma^-1 A) T + X' Gamma^-1, T = R^-1 Q_1' [0; L^-1] from what set_complement has left. */
static void set_load_gain(AddedNoise *noise) {
    const Map *file = &noise->original;
    const size_t n = file->n_gauges, states = file->n_states, order = n + states;
    double *of_residual = noise->rows, *of_states = noise->rows + N_LOADS * n;
    for (size_t i = 0; i < N_LOADS; i++) {
        for (size_t j = 0; j < n; j++) {
            double sum = 0.0;
            for (size_t k = j; k < n; k++) {
                sum += noise->regression[i * n + k] * noise->noise_whitening[triangle_column(k) + j];
            }
            of_residual[i * n + j] = sum;
        }
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

/* Matrices at the nominal dynamic pressure, which are all of form "absolute". */
static int set_matrices(AddedNoise *noise) {
    const Map *file = &noise->original;
    const size_t n = file->n_gauges;
    const double of_residual = file->known_prior ? 1.0 : 0.0;
    const double *without = noise->whole != NULL ? noise->whole : file->noise_covariance;
    for (size_t k = 0; k < n * n; k++) {
        noise->square[0][k] = without[k] + noise->added[k];
    }
    if (!lower_root(n, noise->square[0], noise->noise_root, noise->noise_whitening)) {
        return 0;
    }
    set_remainder(noise);
    set_complement(noise, of_residual, noise->residual_triangle);
    if (of_residual == file->regularisation) {
        memcpy(noise->gain_triangle, noise->residual_triangle, n * (n + 1) / 2 * sizeof *noise->gain_triangle);
    } else {
        set_complement(noise, file->regularisation, noise->gain_triangle);
    }
    set_load_gain(noise);
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

int added_noise_apply(AddedNoise *noise, Map *map, MaskedMap *masked, Workspace *work) {
    const size_t n = noise->original.n_gauges;
    int some = noise->own != NULL;
    *map = noise->original;
    if (noise->further != NULL) {
        noise->further->load = noise->further->map.load;
        noise->further->unseen = noise->further->map.unseen;
    }
    for (size_t k = 0; k < n * n; k++) {
        some |= noise->added[k] != 0.0;
    }
    if (!some) {
        return 1;
    }
    if (!set_matrices(noise) || (map->scaled && !set_pressure_directions(noise))) {
        return 0;
    }
    map->residual_triangle = noise->residual_triangle;
    map->gain_triangle = noise->gain_triangle;
    map->noise_whitening = noise->noise_whitening;
    map->noise_root = noise->noise_root;
    map->load_gain = noise->load_gain;
    map->regression = noise->regression;
    map->remainder = noise->remainder;
    map->min_precision = noise->min_precision;
    if (map->scaled) {
        map->form.whitening = noise->whitening;
        map->form.singular = noise->singular;
        map->form.load = noise->load;
        map->form.unseen = noise->unseen;
        map->form.min_precision = noise->form_min_precision;
        if (noise->further != NULL) {
            noise->further->load = noise->further->own_load;
            noise->further->unseen = noise->further->own_unseen;
        }
    }
    set_load_covariance(noise, map, masked, work);
    map->load_covariance = noise->load_covariance;
    return 1;
}
