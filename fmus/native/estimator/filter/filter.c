#include "filter.h"

#include <math.h>

#include "../numerics/arrays.h"
#include "../numerics/blocks.h"
#include "../numerics/cholesky.h"
#include "filter_known.h"

static size_t larger(size_t a, size_t b) {
    return a > b ? a : b;
}

static size_t sample_doubles(const Filter *filter) {
    const size_t rows = filter->rows, order = filter->laws.order, few = N_STATES + 1;
    return filter->laws.n_considered + rows * (4 * order + 6 * rows + few + 2 * N_COLUMNS + filter->row_whitened + 2)
         + order * (few + N_STATES + 5 * order) + rows * (order - N_STATES) + (filter->laws.n + few) * rows
         + larger(rows, order) * order + filter->laws.n * WIDE_COLUMNS + filter->map.n_other * rows + 2 * order;
}

size_t filter_doubles(Filter *filter, FlightSolver *solver, const Thermal *thermal, size_t n_strains) {
    const FlightMap *flight = solver->map;
    Laws *laws = &filter->laws;
    filter->solver = solver;
    filter->gauges = solver->n;
    filter->rows = filter->gauges + in_lanes(N_NAVIGATION);
    filter->first_e = FIRST_SEEN + filter->map.n_seen;
    filter->n_read = filter->first_e + 1 + flight->n_common + filter->map.n_shared;
    filter->n_terms = (size_t)flight->has_gain_error + filter->map.n_own + filter->map.n_terms;
    laws->thermal = thermal;
    laws->n_sensors = thermal->present ? thermal->map.n_sensors : 0;
    laws->n_modes = filter->map.n_modes;
    laws->n_pairs = N_STATES;
    laws->n = filter->n_read + N_STATES;
    laws->order = in_lanes(laws->n);
    laws->n_considered = filter->n_terms * filter->gauges;
    laws->slow = filter->map.slow;
    laws->first_slow = FIRST_NAVIGATION;
    laws->end_slow = laws->first_widened = FIRST_SEEN;
    laws->end_widened = filter->first_e;
    zero_errors_lay_out(n_strains, filter->gauges, &laws->zeros);
    filter->row_whitened = in_lanes(laws->n + N_STATES + 1);
    return laws_doubles(laws) + response_doubles(&flight->tables) + sample_doubles(filter) + filter_known_doubles(filter);
}

/* A matrix (n_gauges, n_gauges) of the map in one of all rows, with zeros beyond. */
static void widen(const Filter *filter, const double *source, double *matrix) {
    const size_t n = filter->solver->n_gauges;
    for (size_t i = 0; i < n; i++) {
        memcpy(matrix + i * filter->rows, source + i * n, n * sizeof *matrix);
    }
}

void filter_arrays(Filter *filter, double **doubles) {
    const size_t rows = filter->rows, order = filter->laws.order;
    filter->laws.wide = filter->solver->wide;
    laws_arrays(&filter->laws, doubles);
    response_arrays(&filter->solver->map->tables, &filter->slope_response, doubles);
    filter->noise = taken(doubles, rows * rows);
    filter->rest = taken(doubles, rows * rows);
    filter->read = taken(doubles, order * rows);
    filter->term = taken(doubles, filter->laws.n_considered);
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
    filter->kalman = taken(doubles, (filter->laws.n + N_STATES + 1) * rows);
    filter->squares = taken(doubles, rows);
    filter->product = taken(doubles, order * rows);
    filter->turned = taken(doubles, larger(rows, order) * order);
    filter->kept = taken(doubles, order * order);
    filter->joseph = taken(doubles, 3 * order * order);
    filter->strip = taken(doubles, filter->laws.n * WIDE_COLUMNS);
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

/* Variance of a state that is no rate, in the stationary law. */
static double stationary_variance(const Filter *filter, size_t state) {
    if (state < N_STATES) {
        return 1.0 / filter->solver->map->prior_precision[state];
    }
    return 1.0;
}

void filter_set_time_constant(Filter *filter, double time_constant) {
    if (filter->time_constant == time_constant) {
        return;
    }
    filter->time_constant = time_constant;
    Laws *laws = &filter->laws;
    const FlightMap *flight = filter->solver->map;
    double *covariance = laws->stationary.covariance;
    memset(laws->stationary.mean, 0, law_doubles(laws) * sizeof(double));
    memcpy(laws->stationary.mean, flight->prior_mean, N_STATES * sizeof(double));
    for (size_t i = 0; i < filter->n_read; i++) {
        covariance[i * laws->order + i] = stationary_variance(filter, i);
    }
    for (size_t k = 0; k < N_STATES; k++) {
        const double std = filter->map.rate[k] * (1.0 + filter->map.rate_time / time_constant);
        laws->rate[k] = std * sqrt(flight->prior_precision[k]);
        covariance[(filter->n_read + k) * (laws->order + 1)] = std * std;
    }
}

/* Whether a serialised track may be read. */
static int track_fits(const Filter *filter, const FilterTrack *track) {
    int good = (track->has_law == 0.0 || track->has_law == 1.0) && isfinite(track->time) && isfinite(track->now)
            && track->mean >= 0.0 && isfinite(track->mean) && track->steps >= 0.0 && isfinite(track->steps)
            && track->widening >= 1.0 && track->widening <= filter->map.largest_widening;
    for (size_t k = 0; k < N_NAVIGATION; k++) {
        good = good && track->apart[k] >= 0.0 && isfinite(track->apart[k]) && isfinite(track->alarms[k]);
    }
    for (size_t k = 0; k < N_STATES; k++) {
        good = good && isfinite(track->slope_state[k]);
    }
    return good && track->slope_age >= 0.0 && isfinite(track->slope_age);
}

size_t filter_state_size(const Filter *filter) {
    return filter->present ? sizeof filter->base + law_state_size(&filter->laws) : 0;
}

void filter_write_state(const Filter *filter, unsigned char *bytes) {
    if (filter->present) {
        memcpy(bytes, &filter->base, sizeof filter->base);
        law_write_state(&filter->laws, filter->base.has_law != 0.0, bytes + sizeof filter->base);
    }
}

int filter_state_fits(const Filter *filter, const unsigned char *bytes) {
    FilterTrack track;
    if (!filter->present) {
        return 1;
    }
    memcpy(&track, bytes, sizeof track);
    return track_fits(filter, &track) && law_state_fits(&filter->laws, bytes + sizeof track);
}

void filter_read_state(Filter *filter, const unsigned char *bytes) {
    if (filter->present) {
        memcpy(&filter->base, bytes, sizeof filter->base);
        law_read_state(&filter->laws, bytes + sizeof filter->base);
    }
}
