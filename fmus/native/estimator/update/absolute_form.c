#include "absolute_form.h"

#include "../numerics/arrays.h"
#include "../numerics/panels.h"
#include "../numerics/triangles.h"

size_t absolute_doubles(const Map *map) {
    return map->n_gauges + 2 * panel_length(map->n_gauges);
}

void absolute_arrays(const Map *map, AbsoluteStep *step, double **doubles) {
    step->residual = taken(doubles, map->n_gauges);
    step->z = taken(doubles, panel_length(map->n_gauges));
    step->whitened = taken(doubles, panel_length(map->n_gauges));
}

/* Sum of the gains of the gauges in use, weighted with x: loads that strains x stand for. */
static void gain_times(const MaskedMap *m, const double *restrict x, double *restrict loads) {
    double even[LOAD_STRIDE] = {0.0}, odd[LOAD_STRIDE] = {0.0};
    size_t k = 0;
    for (; k + 2 <= m->n_used; k += 2) {
        const double *restrict gain = m->load_gain + LOAD_STRIDE * k;
        for (size_t i = 0; i < LOAD_STRIDE; i++) {
            even[i] += gain[i] * x[k];
            odd[i] += gain[i + LOAD_STRIDE] * x[k + 1];
        }
    }
    if (k < m->n_used) {
        for (size_t i = 0; i < LOAD_STRIDE; i++) {
            even[i] += m->load_gain[LOAD_STRIDE * k + i] * x[k];
        }
    }
    for (size_t i = 0; i < N_LOADS; i++) {
        loads[i] = even[i] + odd[i];
    }
}

/* What the strains in use differ by from those of the mean state. */
static void set_residual(const Map *map, const MaskedMap *m, const double *strain, double *residual) {
    if (m->n_used == map->n_gauges) {
        for (size_t k = 0; k < m->n_used; k++) {
            residual[k] = strain[k] - m->mean_strain[k];
        }
        return;
    }
    for (size_t k = 0; k < m->n_used; k++) {
        residual[k] = strain[m->used[k]] - m->mean_strain[k];
    }
}

void absolute_condition(const Map *map, int wide, const MaskedMap *masked, const double *strain, AbsoluteStep *step) {
    set_residual(map, masked, strain, step->residual);
    panels_times(wide, masked->n_used, masked->row_panels, step->residual, step->whitened);
    step->chi_square = dot(masked->n_used, step->whitened, step->whitened);
    gain_times(masked, step->residual, step->loads);
    for (size_t i = 0; i < N_LOADS; i++) {
        step->loads[i] += map->load_of_mean[i];
    }
}

void absolute_standardised_residuals(int wide, const MaskedMap *masked, AbsoluteStep *step) {
    panels_transposed_times(wide, masked->n_used, masked->column_panels, step->whitened, step->z);
}
