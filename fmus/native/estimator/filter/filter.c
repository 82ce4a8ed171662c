#include "filter.h"

#include <math.h>

#include "../../core/elementary.h"
#include "../numerics/arrays.h"
#include "../numerics/blocks.h"
#include "../numerics/cholesky.h"
#include "../numerics/products.h"
#include "filter_known.h"
#include "filter_modes.h"

static size_t larger(size_t a, size_t b) {
    return a > b ? a : b;
}

size_t law_doubles(const Filter *filter) {
    const size_t columns = filter->order + filter->n_considered + filter->zeros.columns;
    return filter->order + filter->n * columns + zero_errors_noted(&filter->zeros) + in_lanes(filter->map.n_modes)
         + in_lanes(filter->n_sensors) + in_lanes(filter->n_parameters);
}

void filter_write_law(const Filter *filter, unsigned char *bytes) {
    const Law *law = &filter->law;
    memcpy(bytes, law->mean, sizeof(double) * law_doubles(filter));
    if (!zero_errors_noted_any(&filter->zeros, law->zero)) {
        const size_t before = (size_t)(law->of_zeros - law->mean);
        memset(bytes + sizeof(double) * before, 0, sizeof(double) * filter->n * filter->zeros.columns);
    }
}

static size_t sample_doubles(const Filter *filter) {
    const size_t rows = filter->rows, order = filter->order, few = N_STATES + 1;
    return filter->n_considered + rows * (4 * order + 6 * rows + few + 2 * N_COLUMNS + filter->row_whitened + 2)
         + order * (few + N_STATES + 5 * order) + rows * (order - N_STATES) + (filter->n + few) * rows
         + larger(rows, order) * order + filter->n * WIDE_COLUMNS + filter->map.n_other * rows + 2 * order;
}

size_t filter_doubles(Filter *filter, FlightSolver *solver, const Thermal *thermal, size_t n_strains) {
    const FlightMap *flight = solver->map;
    filter->thermal = thermal;
    filter->n_sensors = thermal->present ? thermal->map.n_sensors : 0;
    filter->solver = solver;
    filter->gauges = solver->n;
    filter->rows = filter->gauges + in_lanes(N_NAVIGATION);
    filter->first_e = FIRST_SEEN + filter->map.n_seen;
    filter->n_read = filter->first_e + 1 + flight->n_common + filter->map.n_shared;
    filter->n = filter->n_read + N_STATES;
    filter->order = in_lanes(filter->n);
    filter->row_whitened = in_lanes(filter->n + N_STATES + 1);
    filter->n_terms = (size_t)flight->has_gain_error + filter->map.n_own + filter->map.n_terms;
    filter->n_considered = filter->n_terms * filter->gauges;
    zero_errors_lay_out(n_strains, filter->gauges, &filter->zeros);
    return 4 * law_doubles(filter) + zero_errors_doubles(&filter->zeros) + response_doubles(&flight->tables) + sample_doubles(filter)
         + filter_known_doubles(filter);
}

static void law_arrays(const Filter *filter, Law *law, double **doubles) {
    law->mean = taken(doubles, filter->order);
    law->covariance = taken(doubles, filter->n * filter->order);
    law->cross = taken(doubles, filter->n * filter->n_considered);
    law->of_zeros = taken(doubles, filter->n * filter->zeros.columns);
    law->zero = taken(doubles, zero_errors_noted(&filter->zeros));
    law->stated = taken(doubles, in_lanes(filter->n_parameters));
    law->amplitude = taken(doubles, in_lanes(filter->map.n_modes));
    law->known = taken(doubles, in_lanes(filter->n_sensors));
}

/* A matrix (n_gauges, n_gauges) of the map in one of all rows, with zeros beyond. */
static void widen(const Filter *filter, const double *source, double *matrix) {
    const size_t n = filter->solver->n_gauges;
    for (size_t i = 0; i < n; i++) {
        memcpy(matrix + i * filter->rows, source + i * n, n * sizeof *matrix);
    }
}

void filter_arrays(Filter *filter, double **doubles) {
    const size_t rows = filter->rows, order = filter->order;
    law_arrays(filter, &filter->law, doubles);
    law_arrays(filter, &filter->next_law, doubles);
    law_arrays(filter, &filter->predicted, doubles);
    law_arrays(filter, &filter->stationary, doubles);
    zero_errors_arrays(&filter->zeros, doubles);
    response_arrays(&filter->solver->map->tables, &filter->slope_response, doubles);
    filter->noise = taken(doubles, rows * rows);
    filter->rest = taken(doubles, rows * rows);
    filter->read = taken(doubles, order * rows);
    filter->term = taken(doubles, filter->n_considered);
    filter->white = taken(doubles, rows * rows);
    filter->considered = taken(doubles, order * rows);
    filter->by_state = taken(doubles, (N_STATES + 1) * order);
    filter->by_row = taken(doubles, (N_STATES + 1) * rows);
    filter->others = taken(doubles, order * order);
    filter->gain = taken(doubles, order * rows);
    filter->gain_turned = taken(doubles, rows * (order - N_STATES));
    filter->spread = taken(doubles, rows * rows);
    filter->inverse = taken(doubles, rows * rows);
    filter->innovation = taken(doubles, rows);
    filter->right = taken(doubles, rows * N_COLUMNS);
    filter->white_right = taken(doubles, rows * N_COLUMNS);
    filter->of_states = taken(doubles, N_STATES * order);
    filter->whitened = taken(doubles, rows * filter->row_whitened);
    filter->kalman = taken(doubles, (filter->n + N_STATES + 1) * rows);
    filter->squares = taken(doubles, rows);
    filter->product = taken(doubles, order * rows);
    filter->turned = taken(doubles, larger(rows, order) * order);
    filter->kept = taken(doubles, order * order);
    filter->joseph = taken(doubles, 3 * order * order);
    filter->strip = taken(doubles, filter->n * WIDE_COLUMNS);
    filter->other_turned = taken(doubles, filter->map.n_other * rows);
    filter->other_by_state = taken(doubles, 2 * order);
    widen(filter, filter->map.noise, filter->noise);
    widen(filter, filter->map.rest_strain, filter->rest);
    filter_known_arrays(filter, doubles);
}

void filter_reset(Filter *filter) {
    memset(&filter->base, 0, sizeof filter->base);
    filter->base.mean = filter->base.widening = 1.0;
    filter->next = filter->base;
    filter->time_constant = 0.0;
}

/* Variance of a state in the stationary law. */
static double stationary_variance(const Filter *filter, size_t state) {
    if (state < N_STATES) {
        return 1.0 / filter->solver->map->prior_precision[state];
    }
    if (state >= filter->n_read) {
        const double rate = filter->rate[state - filter->n_read];
        return rate * rate;
    }
    return 1.0;
}

void filter_set_time_constant(Filter *filter, double time_constant) {
    if (filter->time_constant == time_constant) {
        return;
    }
    filter->time_constant = time_constant;
    for (size_t k = 0; k < N_STATES; k++) {
        filter->rate[k] = filter->map.rate[k] * (1.0 + filter->map.rate_time / time_constant);
    }
    memset(filter->stationary.mean, 0, law_doubles(filter) * sizeof(double));
    for (size_t i = 0; i < filter->n; i++) {
        filter->stationary.covariance[i * filter->order + i] = stationary_variance(filter, i);
    }
    memcpy(filter->stationary.mean, filter->solver->map->prior_mean, N_STATES * sizeof(double));
}

/* The step over a time [s]; the one before, if it was as long. */
static const Motion *motion_over(Filter *filter, double time_step) {
    Motion *motion = &filter->motion;
    if (motion->time_step == time_step && motion->time_constant == filter->time_constant) {
        return motion;
    }
    for (size_t k = 0; k < N_STATES; k++) {
        const double rate = filter->rate[k] * sqrt(filter->solver->map->prior_precision[k]);
        const double turn = rate * time_step, decay = turn < 690.0 ? exponential(-turn) : 0.0;
        motion->pair[k][0][0] = decay * (1.0 + turn);
        motion->pair[k][0][1] = decay * time_step;
        motion->pair[k][1][0] = -decay * rate * turn;
        motion->pair[k][1][1] = decay * (1.0 - turn);
    }
    const double age = time_step / filter->time_constant, slow = age / filter->map.slow;
    motion->factor[0] = slow < 690.0 ? exponential(-slow) : 0.0;
    motion->factor[1] = motion->factor[2] = age < 690.0 ? exponential(-age) : 0.0;
    motion->time_step = time_step;
    motion->time_constant = filter->time_constant;
    return motion;
}

/* to = scale F from, of `count` columns. */
void filter_move_rows(const Filter *filter, size_t count, double scale, const double *from, double *to) {
    const Motion *motion = &filter->motion;
    const int wide = filter->solver->wide;
    const size_t shift = filter->n_read * count;
    for (size_t k = 0; k < N_STATES; k++) {
        const double *x = from + k * count;
        for (size_t part = 0; part < 2; part++) {
            const double *row = motion->pair[k][part];
            combine(wide, count, scale * row[0], x, scale * row[1], x + shift, to + k * count + part * shift);
        }
    }
    const double factor[2] = {scale * motion->factor[0], scale * motion->factor[1]};
    const size_t first = N_STATES * count, seen = FIRST_SEEN * count;
    combine(wide, seen - first, factor[0], from + first, 0.0, from + first, to + first);
    combine(wide, shift - seen, factor[1], from + seen, 0.0, from + seen, to + seen);
}

/* One row times F'. */
static void move_columns(const Filter *filter, const Motion *motion, double *row) {
    for (size_t k = 0; k < N_STATES; k++) {
        const double x = row[k], v = row[filter->n_read + k];
        row[k] = motion->pair[k][0][0] * x + motion->pair[k][0][1] * v;
        row[filter->n_read + k] = motion->pair[k][1][0] * x + motion->pair[k][1][1] * v;
    }
    const double of_navigation = motion->factor[0], of_seen = motion->factor[1];
    for (size_t i = N_STATES; i < FIRST_SEEN; i++) {
        row[i] *= of_navigation;
    }
    for (size_t i = FIRST_SEEN; i < filter->n_read; i++) {
        row[i] *= of_seen;
    }
}

/* Add what the process forgets: P - F P F' of the stationary P, whose discrepancy is `widening` times the map's. */
static void add_forgotten(const Filter *filter, const Motion *motion, double widening, double *covariance) {
    const size_t order = filter->order;
    for (size_t i = N_STATES; i < filter->n_read - filter->map.n_modes; i++) {
        const double factor = motion->factor[i >= FIRST_SEEN];
        const double variance = i >= FIRST_SEEN && i < filter->first_e ? widening : 1.0;
        covariance[i * order + i] += variance - factor * variance * factor;
    }
    filter_forget_modes(filter, motion->factor[1], covariance);
    for (size_t k = 0; k < N_STATES; k++) {
        const size_t at[2] = {k, filter->n_read + k};
        const double variance[2] = {stationary_variance(filter, at[0]), stationary_variance(filter, at[1])};
        for (size_t i = 0; i < 2; i++) {
            for (size_t j = 0; j < 2; j++) {
                const double *a = motion->pair[k][i], *b = motion->pair[k][j];
                const double kept = a[0] * variance[0] * b[0] + a[1] * variance[1] * b[1];
                covariance[at[i] * order + at[j]] += (i == j ? variance[i] : 0.0) - kept;
            }
        }
    }
}

/* The mean of a symmetric matrix and its transpose, against round-off. */
static void symmetrise(size_t n, size_t order, double *matrix) {
    for (size_t i = 0; i < n; i++) {
        for (size_t j = 0; j < i; j++) {
            matrix[i * order + j] = matrix[j * order + i] = 0.5 * (matrix[i * order + j] + matrix[j * order + i]);
        }
    }
}

void filter_predict(Filter *filter, double time_step) {
    const Motion *motion = motion_over(filter, time_step);
    const size_t order = filter->order;
    const double *middle = filter->solver->map->prior_mean;
    Law *out = &filter->predicted;
    memcpy(out->mean, filter->law.mean, order * sizeof *out->mean);
    for (size_t k = 0; k < N_STATES; k++) {
        out->mean[k] -= middle[k];
    }
    filter_carry_modes(filter, out);
    move_columns(filter, motion, out->mean);
    for (size_t k = 0; k < N_STATES; k++) {
        out->mean[k] += middle[k];
    }
    filter_move_rows(filter, order, 1.0, filter->law.covariance, out->covariance);
    for (size_t i = 0; i < filter->n; i++) {
        move_columns(filter, motion, out->covariance + i * order);
    }
    add_forgotten(filter, motion, filter->base.widening, out->covariance);
    symmetrise(filter->n, order, out->covariance);
    zero_errors_note(&filter->zeros, out->zero);
    filter_note_known(filter, out);
    if (filter->zeros.in_use) {
        filter_move_rows(filter, filter->zeros.columns, 1.0, filter->law.of_zeros, out->of_zeros);
    }
}

int filter_track_fits(const Filter *filter, const FilterTrack *track, const unsigned char *law) {
    int good = (track->has_law == 0.0 || track->has_law == 1.0) && isfinite(track->time) && isfinite(track->now)
            && track->mean >= 0.0 && isfinite(track->mean) && track->steps >= 0.0 && isfinite(track->steps)
            && track->widening >= 1.0 && track->widening <= filter->map.largest_widening;
    for (size_t k = 0; k < N_NAVIGATION; k++) {
        good = good && track->apart[k] >= 0.0 && isfinite(track->apart[k]) && isfinite(track->alarms[k]);
    }
    for (size_t k = 0; k < N_STATES; k++) {
        good = good && isfinite(track->slope_state[k]);
    }
    good = good && track->slope_age >= 0.0 && isfinite(track->slope_age);
    for (size_t k = 0; k < law_doubles(filter); k++) {
        double value;
        memcpy(&value, law + k * sizeof value, sizeof value);
        good = good && isfinite(value);
    }
    return good;
}
