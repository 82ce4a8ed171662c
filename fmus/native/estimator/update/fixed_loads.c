/* Loads by direction of a map in form "absolute": the gain of its regularisation gamma, and what noise and prior
   leave of the loads.

   Strain and loads are d - m = A q + e and f - f_mean = M q + g. The loads g that no state has go with the errors of
   strain: with N (n, n_errors) the strain of the errors and N_f (5, n_errors) their loads,

       X = cov(e, g) = N N_f',     cov e = Gamma = Gamma_g + N N',     cov g = N_f N_f'.

   pressure_directions.c gives directions V with V Gamma V' = 1, signal S_a of the states and loads G_a by states. In
   direction a the noise has the load b_a = (X' V')_a, and a state of prior variance 1 / gamma the gain

       k_a = u_a S_a G_a / gamma + u_a b_a,     u_a = 1 / (1 + S_a^2 / gamma),

   G_a itself for a free state, b_a where no state is seen. Under the truth (prior variance 1) the error of the loads
   is, direction by direction, k_a - b_a times the noise and G_a - k_a S_a times the state; both are kept, since the
   covariance is the sum of their squares (Joseph's form). Independent of all strain remains

       cov g - X' Gamma^-1 X = (N_f - B N)(N_f - B N)' + B Gamma_g B',     B = X' Gamma^-1,

   a sum of squares, which loses no digits to cancellation: it joins R. docs/explanation/theory.md, "Case 2"
   (eq:svd-solution) and "What a sigma is made of"; strainfmu/estimator/reference/update.py, condition and joseph. */

#include "fixed_loads.h"

#include <string.h>

#include "../numerics/triangles.h"

/* Scratch: X' and B, both (5, n_gauges). */
size_t fixed_loads_doubles(const Map *map) {
    return 2 * N_LOADS * map->n_gauges;
}

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
        /* b_a = (X' V')_a, and B = X' Gamma^-1 = X' V' V, a direction at a time. */
        split_direction(noise, a, of_noise);
    }
    add_remainder(noise, by_strain);
}
