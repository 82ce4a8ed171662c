/* Linear outputs in addition to the five loads: rolling moment, section loads, hinge moments, of a map in form
   "dynamic_pressure".

   Each of the m loads is linear in states and errors, as the five are:

       f_j = fixed_j + s (of_mean_j + M_j x + M_Nj y),

   with M (n_states, m) `load_per_state`, M_N (n_gauges, m) `spread_load` by the columns of N, and spread_unseen (m)
   the variance of what no column has. added_noise.c turns them into loads of the directions, scaled_form.c
   (scaled_other_load) estimates them when they are read: a step does not compute what nobody reads. This file reads
   the part "other_loads" of map.bin and lists the outputs. A group of loads has up to four arrays (loads, standard
   deviations, coefficients, standard deviations of these), each a run of rows. docs/explanation/dynamic_pressure.md
   has the equations, strainfmu/estimator/other_loads.py the groups. */

#include "sample.h"

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

/* The four arrays of m values follow each other: the place of an output is value * m + row. */
static void lay_out(void *part, Room *room) {
    OtherLoads *other_loads = part;
    const OtherLoadsMap *map = &other_loads->map;
    const size_t m = map->n_loads;
    for (int k = 0; k < N_OTHER_VALUES; k++) {
        other_loads->value[k] = taken(room, m);
    }
    other_loads->output = piece(room, other_loads->n_outputs, sizeof *other_loads->output);
    other_loads->array_start = piece(room, map->n_arrays, sizeof *other_loads->array_start);
    for (size_t a = 0, number = 0; room->next != NULL && a < map->n_arrays; a++) {
        other_loads->array_start[a] = number;
        for (size_t k = 0; k < (size_t)map->array_size[a]; k++) {
            other_loads->output[number++] = (size_t)map->array_value[a] * m + (size_t)map->array_first[a] + k;
        }
    }
}

int other_loads_create(MapFile *file, OtherLoads *other_loads) {
    if (!map_has(file, "other_loads")) {
        return file->good;
    }
    if (!parse(file, &other_loads->map)) {
        return 0;
    }
    for (size_t a = 0; a < other_loads->map.n_arrays; a++) {
        other_loads->n_outputs += (size_t)other_loads->map.array_size[a];
    }
    other_loads->present = other_loads->outdated = map_hand_out(file, lay_out, other_loads);
    return other_loads->present;
}

LoadOutput load_output(double *output, const OtherLoads *other_loads, size_t k) {
    const size_t j = k - N_LOADS;
    double *const *value = other_loads->value;
    if (k < N_LOADS) {
        return (LoadOutput){output + LOADS + k, output + LOADS_STD + k, output + COEFFICIENTS + k, output + COEFFICIENTS_STD + k,
                            k >= N_FORCES};
    }
    return (LoadOutput){value[OTHER_LOADS] + j, value[OTHER_LOADS_STD] + j, value[OTHER_COEFFICIENTS] + j,
                        value[OTHER_COEFFICIENTS_STD] + j, other_loads->map.is_moment[j] > 0.0};
}
