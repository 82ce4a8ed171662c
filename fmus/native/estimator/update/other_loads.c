/* Linear outputs in addition to the five loads: rolling moment, section loads, hinge moments, of a map in form
   "dynamic_pressure".

   Each of the m loads is linear in states and errors, as the five are:

       f_j = fixed_j + s (of_mean_j + M_j x + M_Nj y),

   with M (n_states, m) `load_per_state`, M_N (n_gauges, m) `spread_load` by the columns of N, and spread_unseen (m)
   the variance of what no column has. pressure_directions.c turns them into loads of the directions, scaled_form.c
   (scaled_other_load) estimates them when they are read: a step does not compute what nobody reads. This file reads
   the part "other_loads" of map.bin and lists the outputs. A group of loads has up to four arrays (loads, standard
   deviations, coefficients, standard deviations of these), each a run of rows. docs/explanation/dynamic_pressure.md
   has the equations, strainfmu/estimator/other_loads.py the groups. */

#include "other_loads.h"

#include <stdlib.h>

/* Whether a number is a whole one from 0 to `most`. */
static int is_index(double value, size_t most) {
    return value >= 0.0 && value <= (double)most && value == (double)(size_t)value;
}

/* Read the part; numbers that C uses as an index are checked. */
static int parse(MapFile *file, OtherLoadsMap *map) {
    MAP_READ(file, "other_loads", OTHER_LOADS, OtherLoadsMap, map);
    const size_t m = map->n_loads, count = map->n_arrays;
    for (size_t j = 0; file->good && j < m; j++) {
        map_require(file, is_index(map->like[j], N_LOADS), "other_loads.like", "numbers of loads");
    }
    for (size_t a = 0; file->good && a < count; a++) {
        const int is_value = is_index(map->array_value[a], N_OTHER_VALUES - 1);
        const int is_first = is_index(map->array_first[a], m), is_size = is_index(map->array_size[a], m);
        map_require(file, is_value, "other_loads.array_value", "0 to 3");
        map_require(file, is_first && is_size && map->array_size[a] > 0.0 && map->array_first[a] + map->array_size[a] <= (double)m,
                    "other_loads.array_size", "rows of the loads");
    }
    return file->good;
}

/* Place of each output among the four arrays of m values, which follow each other in memory: value * m + row. */
static int list_outputs(MapFile *file, OtherLoads *other_loads) {
    const OtherLoadsMap *map = &other_loads->map;
    for (size_t a = 0; a < map->n_arrays; a++) {
        other_loads->n_outputs += (size_t)map->array_size[a];
    }
    other_loads->output = map_take(file, (other_loads->n_outputs + map->n_arrays) * sizeof(size_t));
    if (other_loads->output == NULL) {
        return 0;
    }
    other_loads->array_start = other_loads->output + other_loads->n_outputs;
    size_t number = 0;
    for (size_t a = 0; a < map->n_arrays; a++) {
        other_loads->array_start[a] = number;
        for (size_t k = 0; k < (size_t)map->array_size[a]; k++) {
            other_loads->output[number++] = (size_t)map->array_value[a] * map->n_loads + (size_t)map->array_first[a] + k;
        }
    }
    return 1;
}

int other_loads_create(MapFile *file, size_t n_gauges, OtherLoads *other_loads) {
    if (!map_has(file, "other_loads")) {
        return file->good;
    }
    if (!parse(file, &other_loads->map)) {
        return 0;
    }
    const size_t m = other_loads->map.n_loads;
    const size_t count = 2 * n_gauges * m + n_gauges + N_OTHER_VALUES * m;
    other_loads->rows = map_take(file, count * sizeof(double));
    if (other_loads->rows == NULL || !list_outputs(file, other_loads)) {
        return 0;
    }
    other_loads->growth = other_loads->rows + 2 * m * n_gauges;
    other_loads->value[0] = other_loads->growth + n_gauges;
    for (int k = 1; k < N_OTHER_VALUES; k++) {
        other_loads->value[k] = other_loads->value[k - 1] + m;
    }
    other_loads->present = other_loads->outdated = 1;
    return 1;
}
