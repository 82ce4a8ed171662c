/* Linear outputs of a map in form "dynamic_pressure" in addition to the five loads, computed when they are read: part
   "other_loads" of resources/map.bin. */

#ifndef OTHER_LOADS_H
#define OTHER_LOADS_H

#include "../map/map_resource.h"

#define OUTPUT_NAME_SIZE 48

/* Loads of states and errors; the arrays point into the bytes of the file. */
typedef struct {
    MAP_MEMBERS(OTHER_LOADS)
} OtherLoadsMap;

/* Each array of (n_loads). */
enum { OTHER_LOADS, OTHER_LOADS_STD, OTHER_COEFFICIENTS, OTHER_COEFFICIENTS_STD, N_OTHER_VALUES };

typedef struct {
    int present;         /* whether the map has such loads; if not, nothing else is set */
    OtherLoadsMap map;      /* as the file has it */
    double *rows;        /* (2 n_loads, n_gauges) scratch of added_noise.h */
    double *growth;      /* (n_gauges) scratch */
    double *value[N_OTHER_VALUES]; /* (n_loads) [N, N m, 1, 1] */
    size_t n_gauges, n_outputs; /* of all arrays */
    size_t *output;        /* (n_outputs) place of each in value[0] and what follows it */
    size_t *array_start;   /* (n_arrays) number of its first output */
    int outdated;
} OtherLoads;

/* Read the part, if there is one, and allocate. 1; 0 after a message. */
int other_loads_create(MapFile *file, size_t n_gauges, OtherLoads *other_loads);

#endif
