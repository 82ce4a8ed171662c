/* Part "flight" of map.bin: tables over the flight state, its ranges, errors of strain and loads about the tables,
   numbers of the solver.

   Tables have the shape (n_mach + 2, n_incidence + 2, n_channels, n_harmonics): coefficients of cubic splines with
   fourfold end knots, two more than knots. A row (gauge or load) is a sum of one or two terms, each a channel with
   factors of its harmonics; terms are listed by ascending row without a gap, which lets flight_tables.c walk through
   them once. Numbers that C uses as an index are checked to be whole and in range here.
   docs/explanation/nonlinear_estimator.md, "Model" and "Model discrepancy";
   strainfmu/estimator/tables/manifold_map.py has quantities and units. */

#include "flight_map.h"

#include <stdio.h>

#include "map_resource.h"

#define MAX_ITERATIONS 1000
#define MAX_STEPS 1000000
#define MAX_KNOTS 4096

/* PART.NAME */
typedef struct {
    char text[48];
} Name;

static Name named(const char *part, const char *name) {
    Name full_name;
    snprintf(full_name.text, sizeof full_name.text, "%s.%s", part, name);
    return full_name;
}

/* Whether rows ascend without a gap. */
static int rows_ascend(const TableMap *tables) {
    double last = -1.0;
    int good = 1;
    for (size_t t = 0; t < tables->n_terms; t++) {
        const double row = tables->row[t];
        good = good && (row == last || row == last + 1.0) && row >= 0.0;
        last = row;
    }
    return good && last == (double)(tables->n_rows - 1);
}

static int channels_exist(const TableMap *tables) {
    int good = 1;
    for (size_t t = 0; t < tables->n_terms; t++) {
        const double channel = tables->channel[t];
        good = good && channel >= 0.0 && channel < (double)tables->n_channels && channel == (double)(size_t)channel;
    }
    return good;
}

int tables_parse(MapFile *file, const char *part, size_t n_rows, TableMap *tables) {
    const Name table = named(part, "table"), row = named(part, "row"), channel = named(part, "channel");
    tables->n_rows = n_rows;
    tables->n_channels = map_length(file, table.text, 2, 1, 2 * n_rows);
    tables->n_harmonics = map_length(file, table.text, 3, 1, MAX_KNOTS);
    tables->n_terms = map_length(file, row.text, 0, n_rows, 2 * n_rows);
    const size_t terms = tables->n_terms, harmonics = tables->n_harmonics;
    tables->table = map_doubles(file, table.text, tables->n_mach + 2, tables->n_incidence + 2, tables->n_channels,
                                harmonics);
    tables->row = map_doubles(file, row.text, terms);
    tables->channel = map_doubles(file, channel.text, terms);
    tables->cosine = map_doubles(file, named(part, "cosine").text, terms, harmonics);
    tables->sine = map_doubles(file, named(part, "sine").text, terms, harmonics);
    tables->fixed = map_doubles(file, named(part, "fixed_response").text, n_rows);
    return file->good && map_require(file, rows_ascend(tables), row.text, "rows that ascend without a gap")
        && map_require(file, channels_exist(tables), channel.text, "channels of the table");
}

static const double *take_knots(MapFile *file, const char *name, size_t *count) {
    *count = map_length(file, name, 0, 2, MAX_KNOTS);
    const double *knots = map_doubles(file, name, *count);
    for (size_t i = 1; file->good && i < *count; i++) {
        map_require(file, knots[i] > knots[i - 1], name, "numbers that increase");
    }
    return knots;
}

/* `low` and a number not below it. */
static void take_range(MapFile *file, const char *name, double range[2]) {
    map_copy(file, name, 2, range);
    map_require(file, range[0] > 0.0 && range[1] >= range[0], name, "a range above zero");
}

static void copy_positives(MapFile *file, const char *name, size_t count, double *values) {
    map_positives(file, name, count);
    map_copy(file, name, count, values);
}

static void take_ranges(MapFile *file, FlightMap *map) {
    take_range(file, "flight.mach_range", map->mach_range);
    take_range(file, "flight.pressure_range", map->pressure_range);
    map_copy(file, "flight.log_pressure_range", 2, map->log_pressure_range);
    map_require(file, map->log_pressure_range[1] > map->log_pressure_range[0], "flight.log_pressure_range",
                "numbers that increase");
    map->middle_log_pressure = map_number(file, "flight.middle_log_pressure");
    map->incidence_limit = map_positive(file, "flight.incidence_limit");
    map->has_crossflow_range = (double)map_count(file, "flight.has_crossflow_range", 0, 1);
    map_copy(file, "flight.crossflow_middle", 2, map->crossflow_middle);
    copy_positives(file, "flight.crossflow_half", 2, map->crossflow_half);
    map->outside_score = map_number(file, "flight.outside_score");
    map->range_tolerance = map_number(file, "flight.range_tolerance");
}

static void take_navigation(MapFile *file, FlightMap *map) {
    map_copy(file, "flight.navigation_error", N_NAVIGATION, map->error);
    map->altitude_error = map_number(file, "flight.altitude_error");
    map_copy(file, "flight.prior_mean", N_STATES, map->prior_mean);
    copy_positives(file, "flight.prior_precision", N_STATES, map->prior_precision);
    map_copy(file, "flight.navigation_limit", N_NAVIGATION, map->navigation_limit);
    map->navigation_alarm = map_number(file, "flight.navigation_alarm");
    map->half_gamma = map_number(file, "flight.half_gamma");
    map->log_half_gamma = map_number(file, "flight.log_half_gamma");
}

static void take_solver(MapFile *file, FlightMap *map) {
    copy_positives(file, "flight.largest_step", N_STATES, map->largest_step);
    map->min_gain = map_number(file, "flight.min_gain");
    map->min_incidence_score = map_number(file, "flight.min_incidence_score");
    map->search_every = (double)map_count(file, "flight.search_every", 0, MAX_STEPS);
    map->return_after = (double)map_count(file, "flight.return_after", 0, MAX_STEPS);
    const size_t start = map_count(file, "flight.start_iterations", 2, MAX_ITERATIONS);
    map_require(file, start % 2 == 0, "flight.start_iterations", "an even number");
    map->start_iterations = (double)start;
    map->cold_iterations = (double)map_count(file, "flight.cold_iterations", 0, MAX_ITERATIONS);
    map->warm_iterations = (double)map_count(file, "flight.warm_iterations", 0, MAX_ITERATIONS);
}

static void take_errors(MapFile *file, FlightMap *map, size_t n) {
    map->n_common = map_length(file, "flight.common_error", 0, 0, MAX_KNOTS);
    map->n_shapes = map_length(file, "flight.shapes", 0, 0, MAX_SHAPES);
    map->gain_std = map_doubles(file, "flight.gain_std", n);
    map->common_gain = map_doubles(file, "flight.common_gain", n);
    map->gauge_covariance = map_covariance(file, "flight.gauge_covariance", n);
    map->scaled_covariance = map_doubles(file, "flight.scaled_covariance", n, n);
    map->load_strain_covariance = map_doubles(file, "flight.load_strain_covariance", N_LOADS, n);
    map->load_covariance = map_doubles(file, "flight.load_covariance", N_LOADS, N_LOADS);
    map->gauge_error_product = map_doubles(file, "flight.gauge_error_product", N_PAIRS, n);
    map->common_error = map_doubles(file, "flight.common_error", map->n_common, 1 + N_LOADS, n);
    map->n_considered_common = map_length(file, "flight.considered_common", 0, 0, MAX_KNOTS);
    map->considered_covariance = map_doubles(file, "flight.considered_covariance", n, n);
    map->considered_load_strain_covariance = map_doubles(file, "flight.considered_load_strain_covariance", N_LOADS, n);
    map->considered_load_covariance = map_doubles(file, "flight.considered_load_covariance", N_LOADS, N_LOADS);
    map->considered_common = map_doubles(file, "flight.considered_common", map->n_considered_common, 1 + N_LOADS, n);
    map->shape = map_doubles(file, "flight.shapes", map->n_shapes, n);
    map->chi_square_limit = map_doubles(file, "flight.chi_square_limit", n + N_NAVIGATION + 1);
    map->chi_square_scale = map_number(file, "flight.chi_square_scale");
    map->outlier_scale = map_number(file, "flight.outlier_scale");
    map->shape_limit = map_number(file, "flight.shape_limit");
    map->outlier_threshold = map_number(file, "flight.outlier_threshold");
    map->has_gain_error = 0;
    for (size_t g = 0; file->good && g < n; g++) {
        map->has_gain_error |= map->gain_std[g] > 0.0;
    }
}

int considered_parse(MapFile *file, size_t n_gauges, size_t n_loads, FlightMap *map) {
    if (map_has(file, "considered")) {
        map->considered = map->tables; /* for the knots */
        tables_parse(file, "considered", n_gauges + n_loads, &map->considered);
    }
    return file->good;
}

int flight_map_parse(MapFile *file, size_t n_gauges, FlightMap *map) {
    TableMap *tables = &map->tables;
    map->reference_area = map_positive(file, "flight.reference_area");
    map->reference_length = map_positive(file, "flight.reference_length");
    tables->min_incidence = map_positive(file, "flight.min_incidence");
    tables->mach_knots = take_knots(file, "flight.mach_knots", &tables->n_mach);
    tables->incidence_knots = take_knots(file, "flight.incidence_knots", &tables->n_incidence);
    tables_parse(file, "flight", n_gauges + N_LOADS, tables);
    take_ranges(file, map);
    take_navigation(file, map);
    take_solver(file, map);
    take_errors(file, map, n_gauges);
    return file->good;
}
