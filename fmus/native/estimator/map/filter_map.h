/* The filter over time, part "filter" of resources/map.bin. */

#ifndef FILTER_MAP_H
#define FILTER_MAP_H

#include "flight_map.h"

typedef struct {
    MAP_MEMBERS(FILTER)
} FilterMap;

/* Read the part. 1; 0 with a text that states what is wrong. */
int filter_map_parse(MapFile *file, FilterMap *map);

#endif
