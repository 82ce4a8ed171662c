/* Part "filter" of map.bin: bounds of the time constant [s], the part of the variance of air data that averages out,
   the variance nu_g of each gauge's noise, standard deviations of the rates of (M, u, w, ln p_inf) [1/s] while no
   strain comes. docs/explanation/filter.md, "Model" and "What does not fit". */

#include "filter_map.h"

int filter_map_parse(MapFile *file, FilterMap *map) {
    MAP_READ(file, "filter", FILTER, FilterMap, map);
    return map_require(file, map->largest_time > map->smallest_time, "filter.largest_time",
                       "a number above the smallest time");
}
