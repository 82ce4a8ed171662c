#include "flight_map.h"

#include <math.h>
#include <stdio.h>

#include "../map/map_resource.h"

#define N_FLIGHT_SIZES 8
#define N_FLIGHT_SCALARS 51
#define MAX_ITERATIONS 1000
#define MAX_KNOTS 4096

enum { N_MACH, N_INCIDENCE, N_HARMONICS, N_CHANNELS, N_TERMS, N_COMMON, N_SHAPES };

static uint32_t size_of(const unsigned char *content, int place) {
    return u32_at(content, 4 * (size_t)place);
}

static size_t coefficients(const TableMap *tables) {
    return (tables->n_mach + 2) * (tables->n_incidence + 2) * tables->n_channels * tables->n_harmonics;
}

size_t table_doubles(const TableMap *tables) {
    return coefficients(tables) + tables->n_terms * (2 + 2 * tables->n_harmonics) + tables->n_rows;
}

void take_tables(TableMap *tables, const double **next) {
    tables->table = take_doubles(next, coefficients(tables));
    tables->row = take_doubles(next, tables->n_terms);
    tables->channel = take_doubles(next, tables->n_terms);
    tables->cosine = take_doubles(next, tables->n_terms * tables->n_harmonics);
    tables->sine = take_doubles(next, tables->n_terms * tables->n_harmonics);
    tables->fixed = take_doubles(next, tables->n_rows);
}

int sensible_table_sizes(const TableMap *tables) {
    const size_t rows = tables->n_rows;
    return tables->n_channels >= 1 && tables->n_channels <= 2 * rows && tables->n_terms >= rows
        && tables->n_terms <= 2 * rows;
}

int sensible_terms(const TableMap *tables) {
    double last = -1.0;
    int good = 1;
    for (size_t t = 0; t < tables->n_terms; t++) {
        const double row = tables->row[t], channel = tables->channel[t];
        good = good && (row == last || row == last + 1.0) && row >= 0.0 && channel >= 0.0
            && channel < (double)tables->n_channels && channel == (double)(size_t)channel;
        last = row;
    }
    return good && last == (double)(tables->n_rows - 1);
}

static size_t number_of_doubles(const FlightMap *map, size_t n) {
    const size_t loads = N_LOADS;
    return N_FLIGHT_SCALARS + map->tables.n_mach + map->tables.n_incidence + table_doubles(&map->tables)
         + 2 * n + 2 * n * n + loads * n + loads * loads
         + N_PAIRS * n + 6 * map->n_common * n + map->n_shapes * n + n + N_NAVIGATION + 1;
}

static int sensible_sizes(const FlightMap *map) {
    const TableMap *tables = &map->tables;
    return tables->n_mach >= 2 && tables->n_mach <= MAX_KNOTS && tables->n_incidence >= 2
        && tables->n_incidence <= MAX_KNOTS && tables->n_harmonics >= 1 && tables->n_harmonics <= MAX_KNOTS
        && sensible_table_sizes(tables) && map->n_common <= MAX_KNOTS && map->n_shapes <= MAX_SHAPES;
}

static void copy(const double **next, double *values, size_t count) {
    memcpy(values, take_doubles(next, count), count * sizeof *values);
}

static void take_scalars(FlightMap *map, const double **next) {
    map->reference_area = *take_doubles(next, 1);
    map->reference_length = *take_doubles(next, 1);
    copy(next, map->mach_range, 2);
    copy(next, map->pressure_range, 2);
    copy(next, map->log_pressure_range, 2);
    map->middle_log_pressure = *take_doubles(next, 1);
    map->incidence_limit = *take_doubles(next, 1);
    map->has_crossflow_range = *take_doubles(next, 1);
    copy(next, map->crossflow_middle, 2);
    copy(next, map->crossflow_half, 2);
    copy(next, map->error, N_NAVIGATION);
    map->altitude_error = *take_doubles(next, 1);
    map->chi_square_scale = *take_doubles(next, 1);
    map->outlier_scale = *take_doubles(next, 1);
    copy(next, map->prior_mean, N_STATES);
    copy(next, map->prior_precision, N_STATES);
    copy(next, map->largest_step, N_STATES);
    copy(next, map->navigation_limit, N_NAVIGATION);
    map->navigation_alarm = *take_doubles(next, 1);
    map->shape_limit = *take_doubles(next, 1);
    map->outlier_threshold = *take_doubles(next, 1);
    map->tables.min_incidence = *take_doubles(next, 1);
    map->outside_score = *take_doubles(next, 1);
    map->range_tolerance = *take_doubles(next, 1);
    map->min_gain = *take_doubles(next, 1);
    map->min_incidence_score = *take_doubles(next, 1);
    map->half_gamma = *take_doubles(next, 1);
    map->log_half_gamma = *take_doubles(next, 1);
    map->search_every = *take_doubles(next, 1);
    map->return_after = *take_doubles(next, 1);
    map->start_iterations = *take_doubles(next, 1);
    map->cold_iterations = *take_doubles(next, 1);
    map->warm_iterations = *take_doubles(next, 1);
}

static void take_arrays(FlightMap *map, const double **next, size_t n) {
    map->tables.mach_knots = take_doubles(next, map->tables.n_mach);
    map->tables.incidence_knots = take_doubles(next, map->tables.n_incidence);
    take_tables(&map->tables, next);
    map->gain_std = take_doubles(next, n);
    map->common_gain = take_doubles(next, n);
    map->has_gain_error = 0;
    for (size_t g = 0; g < n; g++) {
        map->has_gain_error |= map->gain_std[g] > 0.0;
    }
    map->gauge_covariance = take_doubles(next, n * n);
    map->scaled_covariance = take_doubles(next, n * n);
    map->load_strain_covariance = take_doubles(next, N_LOADS * n);
    map->load_covariance = take_doubles(next, N_LOADS * N_LOADS);
    map->gauge_error_product = take_doubles(next, N_PAIRS * n);
    map->common_error = take_doubles(next, 6 * map->n_common * n);
    map->shape = take_doubles(next, map->n_shapes * n);
    map->chi_square_limit = take_doubles(next, n + N_NAVIGATION + 1);
}

/* Whether a number of iterations can be: whole, from `least` on. */
static int can_be(double iterations, double least) {
    return iterations >= least && iterations <= MAX_ITERATIONS && iterations == (double)(size_t)iterations;
}

static int increasing(const double *knots, size_t count) {
    int good = 1;
    for (size_t i = 1; i < count; i++) {
        good = good && knots[i] > knots[i - 1];
    }
    return good;
}

static int sensible_values(const FlightMap *map, const double *values, size_t count, size_t n) {
    int good = 1;
    for (size_t i = 0; i < count; i++) {
        good = good && isfinite(values[i]);
    }
    good = good && increasing(map->tables.mach_knots, map->tables.n_mach)
        && increasing(map->tables.incidence_knots, map->tables.n_incidence) && sensible_terms(&map->tables)
        && map->reference_area > 0.0 && map->reference_length > 0.0
        && map->pressure_range[0] > 0.0 && map->log_pressure_range[1] > map->log_pressure_range[0]
        && map->mach_range[1] >= map->mach_range[0] && map->mach_range[0] > 0.0 && map->incidence_limit > 0.0
        && map->crossflow_half[0] > 0.0 && map->crossflow_half[1] > 0.0
        && map->tables.min_incidence > 0.0 && map->search_every >= 0.0 && map->return_after >= 0.0
        && can_be(map->start_iterations, 2.0) && can_be(0.5 * map->start_iterations, 1.0)
        && can_be(map->cold_iterations, 0.0) && can_be(map->warm_iterations, 0.0);
    for (size_t i = 0; i < N_STATES; i++) {
        good = good && map->largest_step[i] > 0.0 && map->prior_precision[i] > 0.0;
    }
    for (size_t i = 0; i < n; i++) {
        good = good && map->gauge_covariance[i * n + i] > 0.0;
    }
    return good;
}

int flight_map_parse(const Section *section, size_t n_gauges, FlightMap *map, char text[MODEL_TEXT_SIZE]) {
    const unsigned char *content = section->content;
    if (section->length < 4 * N_FLIGHT_SIZES) {
        snprintf(text, MODEL_TEXT_SIZE, "holds tables whose sizes cannot be");
        return 0;
    }
    map->tables.n_rows = n_gauges + N_LOADS;
    map->tables.n_mach = size_of(content, N_MACH);
    map->tables.n_incidence = size_of(content, N_INCIDENCE);
    map->tables.n_harmonics = size_of(content, N_HARMONICS);
    map->tables.n_channels = size_of(content, N_CHANNELS);
    map->tables.n_terms = size_of(content, N_TERMS);
    map->n_common = size_of(content, N_COMMON);
    map->n_shapes = size_of(content, N_SHAPES);
    if (!sensible_sizes(map)
        || section->length != 4 * N_FLIGHT_SIZES + 8 * number_of_doubles(map, n_gauges)) {
        snprintf(text, MODEL_TEXT_SIZE, "holds tables whose sizes cannot be");
        return 0;
    }
    const double *values = (const double *)(const void *)(content + 4 * N_FLIGHT_SIZES), *next = values;
    take_scalars(map, &next);
    take_arrays(map, &next, n_gauges);
    if (!sensible_values(map, values, number_of_doubles(map, n_gauges), n_gauges)) {
        snprintf(text, MODEL_TEXT_SIZE, "holds tables with a value that cannot be");
        return 0;
    }
    return 1;
}
