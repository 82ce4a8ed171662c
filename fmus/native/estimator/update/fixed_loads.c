#include "fixed_loads.h"

#include <string.h>

#include "../numerics/triangles.h"

/* Loads g that no state holds go with errors of strain: X = N N_f' (5, n_gauges), then B = X' Gamma^-1. */
size_t fixed_loads_doubles(const Map *map) {
    return 2 * N_LOADS * map->n_gauges;
}

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

/* Direction a of singular value S, whose states have the prior covariance 1 / gamma for the gain and 1 in truth. With loads
   G by states and b by noise, the gain is k = u S G / gamma + u b, u = 1 / (1 + S^2 / gamma); b itself is the gain of a
   direction which shows no state, and G the gain of a free state. Noise leaves k - b, and the prior G - k S. */
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

/* Add V - X' Gamma^-1 X = (N_f - B N) (N_f - B N)' + B Gamma_g B'. */
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

void fixed_loads(AddedNoise *noise) {
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
        split_direction(noise, a, of_noise);
    }
    add_remainder(noise, by_strain);
}
