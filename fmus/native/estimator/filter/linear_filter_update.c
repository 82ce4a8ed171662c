#include "linear_filter_update.h"

#include <math.h>
#include <string.h>

#include "../numerics/cholesky.h"
#include "../numerics/lanes.h"
#include "../numerics/products.h"
#include "law_update.h"

/* `count` rows of strain times a factor, 0 for gauges that are not in use. */
static void set_rows(const LinearFilter *filter, size_t count, double factor, const double *strain, double *out) {
    for (size_t k = 0; k < count; k++) {
        for (size_t g = 0; g < filter->n_gauges; g++) {
            out[k * filter->rows + g] = filter->used[g] ? factor * strain[k * filter->n_gauges + g] : 0.0;
        }
    }
}

static void set_white(LinearFilter *filter) {
    const size_t n = filter->n_gauges, rows = filter->rows;
    const double square = filter->ratio * filter->ratio;
    combine(filter->laws.wide, rows * rows, 1.0, filter->own_covariance, square, filter->rest_covariance, filter->white);
    for (size_t i = 0; i < rows; i++) {
        if (i < n && filter->used[i]) {
            filter->white[i * rows + i] += filter->map.noise[i];
            continue;
        }
        for (size_t j = 0; j < rows; j++) {
            filter->white[i * rows + j] = filter->white[j * rows + i] = 0.0;
        }
        filter->white[i * rows + i] = 1.0;
    }
    if (filter->laws.zeros.in_use) {
        zero_errors_add(&filter->laws.zeros, filter->white, rows);
        for (size_t i = 0; i < n; i++) {
            for (size_t j = 0; j < i; j++) {
                filter->white[i * rows + j] = filter->white[j * rows + i];
            }
        }
    }
}

/* What is known of the states after the sample alone, by information: sums of positive terms. Its loads follow. */
static void set_alone(LinearFilter *filter) {
    const LinearFilterMap *map = &filter->map;
    const size_t rows = filter->rows, n = filter->laws.n, order = filter->laws.order;
    double *whitened = filter->gain, *apart = whitened + n * rows, *cross = apart + rows, *known = filter->turned;
    double *of_loads = filter->joseph, *found = of_loads + N_LOADS * order; /* of the loads; of the strain */
    memcpy(whitened, filter->read, n * rows * sizeof *whitened);
    memcpy(apart, filter->apart, rows * sizeof *apart);
    memset(cross, 0, N_LOADS * rows * sizeof *cross);
    set_rows(filter, N_LOADS, filter->ratio * filter->ratio, map->rest_cross, cross);
    memcpy(filter->factor, filter->white, rows * rows * sizeof *filter->factor);
    cholesky(filter->laws.wide, rows, rows, filter->factor);
    solve_lower(filter->laws.wide, rows, filter->factor, n + 1 + N_LOADS, whitened);
    memset(of_loads, 0, (N_LOADS + 1) * order * sizeof *of_loads);
    for (size_t k = 0; k < n; k++) {
        const double *row = whitened + k * rows;
        for (size_t i = 0; i < N_LOADS; i++) {
            const double load = k < map->n_scaled ? filter->ratio * map->load[k * N_LOADS + i] : 0.0;
            filter->of_load[i * order + k] = load - lane_dot(rows, cross + i * rows, row);
            of_loads[i * order + k] = map->std[k] * filter->of_load[i * order + k];
        }
        found[k] = map->std[k] * lane_dot(rows, apart, row);
    }
    transpose(n, rows, whitened, rows, known, order);
    for (size_t r = 0; r < rows; r++) {
        memset(known + r * order + n, 0, (order - n) * sizeof *known);
    }
    multiply(filter->laws.wide, FULL, n, rows, order, by_rows(whitened, rows), known, order, filter->small, order);
    const size_t modes = map->n_modes, first_mode = n - modes;
    for (size_t i = 0; i < order; i++) {
        for (size_t j = 0; j < order; j++) {
            double *value = filter->small + i * order + j;
            const int of_modes = i >= first_mode && i < n && j >= first_mode && j < n;
            const double prior = of_modes ? filter->laws.thermal->information[(i - first_mode) * modes + (j - first_mode)]
                                          : (i == j ? 1.0 : 0.0);
            *value = (i < n && j < n ? map->std[i] * *value * map->std[j] : 0.0) + prior;
        }
    }
    cholesky(filter->laws.wide, order, order, filter->small);
    solve_lower(filter->laws.wide, order, filter->small, N_LOADS + 1, of_loads);
    for (size_t i = 0; i < N_LOADS; i++) {
        filter->alone[i] = lane_dot(order, of_loads + i * order, found);
        for (size_t j = 0; j < N_LOADS; j++) {
            filter->alone_covariance[i * N_LOADS + j] = lane_dot(order, of_loads + i * order, of_loads + j * order);
        }
    }
}

void linear_filter_read(LinearFilter *filter) {
    const LinearFilterMap *map = &filter->map;
    const size_t rows = filter->rows, first_common = map->n_scaled * rows, n_own = map->n_own;
    set_rows(filter, map->n_scaled, filter->ratio, map->scaled, filter->read);
    set_rows(filter, map->n_common, 1.0, map->common, filter->read + first_common);
    set_rows(filter, n_own, 1.0, map->own, filter->term);
    set_rows(filter, map->n_rest, filter->ratio, map->rest, filter->term + n_own * rows);
    transpose(filter->laws.n, rows, filter->read, rows, filter->read_turned, filter->laws.order);
    transpose(n_own + map->n_rest, rows, filter->term, rows, filter->term_turned, filter->laws.n_considered);
    if (filter->laws.zeros.in_use) {
        zero_errors_read(&filter->laws.zeros, filter->used);
    }
    set_white(filter);
    set_alone(filter);
}

/* P after the sample, as a difference, in filter->laws.next_law; 0 where that has too few digits. */
static int subtract_covariance(LinearFilter *filter, const Law *law, const double *whitened) {
    const size_t n = filter->laws.n, order = filter->laws.order, rows = filter->rows;
    double *taken = filter->joseph, *covariance = filter->laws.next_law.covariance;
    int enough = 1;
    transpose(n, rows, whitened, rows, filter->turned, order);
    multiply(filter->laws.wide, FULL, n, rows, order, by_rows(whitened, rows), filter->turned, order, taken, order);
    for (size_t i = 0; i < n; i++) {
        const double before = law->covariance[i * order + i];
        enough = enough && before - taken[i * order + i] > LEAST_LEFT * before;
        for (size_t j = 0; j <= i; j++) {
            covariance[i * order + j] = covariance[j * order + i] =
                law->covariance[i * order + j] - taken[i * order + j];
        }
    }
    return enough;
}

double linear_filter_update(LinearFilter *filter, const Law *law) {
    const size_t n = filter->laws.n, order = filter->laws.order, rows = filter->rows, considered = filter->laws.n_considered;
    const int wide = filter->laws.wide;
    double *gain = filter->gain, *innovation = gain + n * rows, *half = filter->product;
    Law *after = &filter->laws.next_law;
    law_note(&filter->laws, after);
    multiply(wide, FULL, n, considered, rows, by_rows(law->cross, considered), filter->term, rows, filter->considered,
             rows);
    if (filter->laws.zeros.in_use) {
        zero_errors_considered(&filter->laws.zeros, n, law->of_zeros, filter->considered, rows);
    }
    multiply(wide, FULL, n, n, rows, by_rows(law->covariance, order), filter->read, rows, gain, rows);
    for (size_t k = 0; k < n * rows; k++) {
        half[k] = 0.5 * gain[k] + filter->considered[k];
        gain[k] += filter->considered[k];
    }
    multiply_upper(wide, rows, rows, n, (Strided){filter->read, 1, rows}, half, filter->white, filter->factor);
    multiply_upper(wide, rows, rows, n, (Strided){half, 1, rows}, filter->read, filter->factor, filter->factor);
    multiply(wide, FULL, 1, n, rows, by_rows(law->mean, order), filter->read, rows, innovation, rows);
    for (size_t r = 0; r < rows; r++) {
        innovation[r] = filter->apart[r] - innovation[r];
    }
    cholesky(wide, rows, rows, filter->factor);
    solve_lower(wide, rows, filter->factor, n + 1, gain);
    const double chi_square = lane_dot(rows, innovation, innovation);
    const int enough = subtract_covariance(filter, law, gain);
    for (size_t i = 0; i < n; i++) {
        after->mean[i] = law->mean[i] + lane_dot(rows, gain + i * rows, innovation);
    }
    solve_upper(wide, rows, filter->factor, n, gain);
    multiply(wide, FULL, n, rows, order, by_rows(gain, rows), filter->read_turned, order, filter->kept, order);
    const Joseph joseph = {.rows = rows,           .n_read = n,              .gain = gain,
                           .read = filter->kept,   .white = filter->white,   .considered = filter->considered,
                           .half = filter->product, .turned = filter->turned, .square = filter->joseph};
    if (!enough) {
        law_set_joseph(&filter->laws, &joseph, law, after);
    }
    memcpy(after->cross, law->cross, n * considered * sizeof *after->cross);
    subtract_product(wide, n, n, considered, by_rows(filter->kept, order), law->cross, considered, after->cross,
                     considered);
    subtract_product(wide, n, rows, considered, by_rows(gain, rows), filter->term_turned, considered, after->cross,
                     considered);
    law_update_zeros(&filter->laws, &joseph, law, after);
    return chi_square;
}

void linear_filter_loads(LinearFilter *filter, const Law *law, double *loads, double *covariance) {
    const size_t n = filter->laws.n, order = filter->laws.order;
    double *times = filter->joseph;
    multiply(filter->laws.wide, FULL, N_LOADS, n, order, by_rows(filter->of_load, order), law->covariance, order, times,
             order);
    for (size_t i = 0; i < N_LOADS; i++) {
        loads[i] = lane_dot(order, filter->of_load + i * order, law->mean) - filter->alone[i];
        for (size_t j = 0; j < N_LOADS; j++) {
            covariance[i * N_LOADS + j] = lane_dot(order, times + i * order, filter->of_load + j * order)
                                        - filter->alone_covariance[i * N_LOADS + j];
        }
    }
}
