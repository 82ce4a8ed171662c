/* Part "filter" of map.bin: bounds of the time constant [s], the part of the variance of air data that averages out,
   the variance nu_g of each gauge's noise, standard deviations of the rates of (M, u, w, ln p_inf) [1/s] while no
   strain comes. docs/explanation/filter.md, "Model" and "What does not fit". */

#include "filter_map.h"

int filter_map_parse(MapFile *file, size_t n_gauges, FilterMap *map) {
    map->smallest_time = map_positive(file, "filter.smallest_time");
    map->largest_time = map_positive(file, "filter.largest_time");
    map->white_navigation = map_between(file, "filter.white_navigation", 0.0, 1.0);
    map->noise = map_positives(file, "filter.noise", n_gauges);
    map_positives(file, "filter.rate", N_STATES);
    map_copy(file, "filter.rate", N_STATES, map->rate);
    return map_require(file, map->largest_time > map->smallest_time, "filter.largest_time",
                       "a number above the smallest time");
}
