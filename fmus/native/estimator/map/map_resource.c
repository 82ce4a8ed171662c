/* Parts "linear", "settings", "envelope", "scaled" and "scaled_errors" of map.bin: primary quantities of a linear
   map.

   n gauges, r states, n_e errors:

       m (n), f_mean (5)               strain and loads of the mean pressure, of which d_0, f_0 do not follow q_inf
       A (n, r), M (5, r)              strain and loads per state; free in Case 1, standard normal in Case 2
       Gamma_g (n, n)                  covariance of errors that do not scale
       N (n, n_e), N_f (5, n_e)        strain and loads of errors that scale, per standard deviation
       D_a D_b (21, n), E (t, 6, n)    errors in proportion to strain, and mean(c c') (21)

   A map of many gauges has, instead of Gamma_g and of the gauges' own errors in N, the part "low_rank": variances of each
   gauge, and of what all zeros have in common.

   What follows from them (whitening, directions, gains) is not in the file: update/added_noise.c makes it, so that
   the standard deviations of zero offsets may change. A matrix (n, r) lies in the file as its transpose, a row for
   each state. Infinite bounds are written as the largest finite number, as the container holds finite ones alone.
   docs/explanation/theory.md and docs/explanation/dynamic_pressure.md; strainfmu/estimator/resource/map_file.py
   writes the parts. */

#include "map.h"

#include <math.h>
#include <stdio.h>

#define GUID_SIZE 80

static void take_form(MapFile *file, Map *map) {
    const size_t n = map->n_gauges, n_prior = map->known_prior ? map->n_states : 0;
    ScaledForm *form = &map->form;
    MAP_READ(file, "scaled", SCALED, ScaledForm, form);
    if (!map->has_low_rank) {
        MAP_READ(file, "scaled", SPREAD, ScaledForm, form);
    }
    form->n_fixed = form->follows_pressure ? form->n_free : n;
    form->n_columns = form->follows_pressure || n_prior > n ? n : n_prior;
    form->has_errors = map_has(file, "scaled_errors");
    if (form->has_errors) {
        MAP_READ(file, "scaled_errors", SCALED_ERRORS, ScaledForm, form);
    }
}

/* Start values lie within the limits of settings: the state of an instance that holds them is accepted. */
static void take_settings(MapFile *file, Map *map) {
    MAP_READ(file, "settings", SETTINGS, Map, map);
    const double smallest = map->smallest_setting, largest = map->largest_setting;
    map_require_between(file, "settings.reference_area", map->reference_area, smallest, largest);
    map_require_between(file, "settings.reference_length", map->reference_length, smallest, largest);
    map_require_between(file, "settings.moment_station", map->moment_station, -largest, largest);
    map_require_between(file, "settings.sensor_range", map->sensor_range, smallest, largest);
}

int map_parse(MapFile *file, Map *map) {
    map->checksum = u32_at(file->bytes, CHECKSUM_AT);
    map->guid = map_text(file, "guid", GUID_SIZE);
    MAP_READ(file, "linear", LINEAR, Map, map);
    map->has_low_rank = map_has(file, "low_rank");
    if (map->has_low_rank) {
        MAP_READ(file, "low_rank", LOW_RANK, Map, map);
    } else {
        MAP_READ(file, "linear", GAUGE_COVARIANCE, Map, map);
    }
    take_settings(file, map);
    MAP_READ(file, "envelope", ENVELOPE, Envelope, &map->envelope);
    map->envelope.atmosphere = (Atmosphere){map->envelope.n_layers, map->envelope.layers};
    map->form.n_free = map->known_prior ? 0 : map->n_gauges - (size_t)map->degrees_of_freedom;
    map_require(file, map->known_prior || map->form.n_free == map->n_states, "linear.degrees_of_freedom",
                "that of the gauges less the free states");
    take_form(file, map);
    if (map_has(file, "angles")) {
        MAP_READ(file, "angles", ANGLES, Map, map);
    }
    map->has_tables = map_has(file, "flight");
    map->has_filter = map_has(file, "filter");
    map->has_known = map_has(file, "parameter_tables");
    return file->good;
}

double ambient_pressure(const Envelope *envelope, double altitude) {
    double pressure, temperature;
    return atmosphere_at(&envelope->atmosphere, altitude, &pressure, &temperature) ? pressure : NAN;
}

/* Part "flight" of map.bin: tables over the flight state, its ranges, errors of strain and loads about the tables,
   numbers of the solver.

   Tables have the shape (n_mach + 2, n_incidence + 2, n_channels, n_harmonics): coefficients of cubic splines with
   fourfold end knots, two more than knots. A row (gauge or load) is a sum of one or two terms, each a channel with
   factors of its harmonics; terms are listed by ascending row without a gap, which lets flight_tables.c walk through
   them once. Numbers that C uses as an index are checked to be whole and in range here.
   docs/explanation/nonlinear_estimator.md, "Model" and "Model discrepancy";
   strainfmu/estimator/map/nonlinear_map.py has quantities and units. */

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
    char row[64], channel[64];
    snprintf(row, sizeof row, "%s.row", part);
    snprintf(channel, sizeof channel, "%s.channel", part);
    tables->n_rows = file->length[SYM_ROWS] = n_rows;
    MAP_READ(file, part, TABLES, TableMap, tables);
    return file->good && map_require(file, rows_ascend(tables), row, "rows that ascend without a gap")
        && map_require(file, channels_exist(tables), channel, "channels of the table");
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
    MAP_READ(file, "flight", KNOTS, TableMap, tables);
    tables_parse(file, "flight", n_gauges + N_LOADS, tables);
    MAP_READ(file, "flight", FLIGHT, FlightMap, map);
    map_require(file, map->start_iterations % 2 == 0, "flight.start_iterations", "an even number");
    for (size_t g = 0; file->good && g < n_gauges; g++) {
        map->has_gain_error |= map->gain_std[g] > 0.0;
    }
    return file->good;
}
