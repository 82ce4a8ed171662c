#include "filter_modes.h"

size_t filter_first_mode(const Filter *filter) {
    return filter->n_read - filter->map.n_modes;
}

void filter_set_modes(Filter *filter) {
    const size_t first = filter_first_mode(filter), k = filter->map.n_modes;
    for (size_t mode = 0; mode < k; mode++) {
        double *row = filter->stationary.covariance + (first + mode) * filter->order + first;
        memset(row, 0, k * sizeof *row);
        thermal_add_left(filter->thermal, mode, 1.0, row);
    }
}

void filter_tell_modes(const Filter *filter, Law *law) {
    thermal_tell(filter->thermal, law->amplitude, law->known); /* nothing of a map without modes */
}

void filter_carry_modes(const Filter *filter, Law *out) {
    const Law *law = &filter->law;
    double *mean = out->mean + filter_first_mode(filter);
    filter_tell_modes(filter, out);
    if (memcmp(out->known, law->known, filter->n_sensors * sizeof *out->known) != 0) {
        for (size_t mode = 0; mode < filter->map.n_modes; mode++) {
            mean[mode] += law->amplitude[mode] - out->amplitude[mode];
        }
    }
}

void filter_forget_modes(const Filter *filter, double factor, double *covariance) {
    const size_t first = filter_first_mode(filter);
    for (size_t mode = 0; mode < filter->map.n_modes; mode++) {
        thermal_add_left(filter->thermal, mode, 1.0 - factor * factor, covariance + (first + mode) * filter->order + first);
    }
}
