#include "zero_errors.h"

#include <string.h>

#include "../numerics/arrays.h"
#include "../numerics/lanes.h"

size_t zero_errors_noted(const ZeroErrors *errors) {
    return in_lanes(2 * errors->n_strains + 1);
}

void zero_errors_lay_out(size_t n_strains, size_t n_gauges, ZeroErrors *errors) {
    errors->n_strains = n_strains;
    errors->gauges = in_lanes(n_gauges);
    errors->columns = errors->gauges + LANES;
}

size_t zero_errors_doubles(const ZeroErrors *errors) {
    return zero_errors_noted(errors) + 2 * errors->gauges;
}

void zero_errors_arrays(ZeroErrors *errors, double **doubles) {
    errors->now = taken(doubles, zero_errors_noted(errors));
    errors->own = taken(doubles, errors->gauges);
    errors->common = taken(doubles, errors->gauges);
}

int zero_errors_noted_any(const ZeroErrors *errors, const double *noted) {
    int any = 0;
    for (size_t i = errors->n_strains; i < 2 * errors->n_strains + 1; i++) {
        any |= noted[i] > 0.0;
    }
    return any;
}

void zero_errors_take(ZeroErrors *errors, const double *zeros) {
    const size_t count = 2 * errors->n_strains + 1;
    const int before = errors->in_use;
    errors->in_use = zero_errors_noted_any(errors, zeros);
    if (errors->in_use) {
        memcpy(errors->now, zeros, count * sizeof *zeros);
    } else if (before) {
        memset(errors->now, 0, count * sizeof *zeros);
    }
}

int zero_errors_same(const ZeroErrors *errors, const double *noted) {
    const size_t first = errors->may_move ? errors->n_strains : 0;
    return memcmp(errors->now + first, noted + first, (zero_errors_noted(errors) - first) * sizeof *noted) == 0;
}

void zero_errors_note(const ZeroErrors *errors, double *noted) {
    memcpy(noted, errors->now, zero_errors_noted(errors) * sizeof *noted);
}

void zero_errors_read(ZeroErrors *errors, const unsigned char *used) {
    const size_t n = errors->n_strains;
    for (size_t g = 0; g < n; g++) {
        errors->own[g] = used[g] ? errors->now[n + g] : 0.0;
        errors->common[g] = used[g] ? errors->now[2 * n] : 0.0;
    }
}

void zero_errors_add(const ZeroErrors *errors, double *covariance, size_t row) {
    for (size_t i = 0; i < errors->n_strains; i++) {
        const double common = errors->common[i], own = errors->own[i];
        for (size_t j = i; j < errors->n_strains; j++) {
            covariance[i * row + j] += common * errors->common[j];
        }
        covariance[i * row + i] += own * own;
    }
}

void zero_errors_considered(const ZeroErrors *errors, size_t n, const double *cross, double *sums, size_t row) {
    const double *restrict own = errors->own, *restrict common = errors->common;
    for (size_t k = 0; k < n; k++) {
        const double *restrict of_state = cross + k * errors->columns;
        double *restrict sum = sums + k * row;
        const double all = of_state[errors->gauges];
        for (size_t g = 0; g < errors->gauges; g++) {
            sum[g] += of_state[g] * own[g] + all * common[g];
        }
    }
}

void zero_errors_subtract(const ZeroErrors *errors, size_t n, const double *gain, size_t row, double *cross) {
    const double *restrict own = errors->own, *restrict common = errors->common;
    for (size_t k = 0; k < n; k++) {
        const double *restrict of_state = gain + k * row;
        double *restrict left = cross + k * errors->columns;
        double sum = 0.0;
        for (size_t g = 0; g < errors->gauges; g++) {
            left[g] -= of_state[g] * own[g];
            sum += of_state[g] * common[g];
        }
        left[errors->gauges] -= sum;
    }
}
