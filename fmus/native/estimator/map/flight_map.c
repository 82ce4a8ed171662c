/* Part "flight" of map.bin: tables over the flight state, its ranges, errors of strain and loads about the tables,
   numbers of the solver.

   Tables have the shape (n_mach + 2, n_incidence + 2, n_channels, n_harmonics): coefficients of cubic splines with
   fourfold end knots, two more than knots. A row (gauge or load) is a sum of one or two terms, each a channel with
   factors of its harmonics; terms are listed by ascending row without a gap, which lets flight_tables.c walk through
   them once. Numbers that C uses as an index are checked to be whole and in range here.
   docs/explanation/nonlinear_estimator.md, "Model" and "Model discrepancy";
   strainfmu/estimator/map/nonlinear_map.py has quantities and units. */

#include "flight_map.h"

#include <stdio.h>

#include "map_resource.h"

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
