/* All that a step needs of a map for the gauges that are in use: computed once per set of gauges.

   docs/explanation/theory.md has the formulas, strainfmu/estimator/reference/update.py the equations. */

#ifndef MASKED_MAP_H
#define MASKED_MAP_H

#include "../map/map_resource.h"

/* Entries are by gauge in use, ascending. */
typedef struct {
    unsigned char *mask; /* (n_gauges) 1 for the gauges in use */
    unsigned long number;    /* no other set of gauges, and none before in these arrays, has it */
    size_t n_used;
    int identified;          /* whether they identify the state; if not, what follows is not set */
    size_t *used;            /* (n_used) their indices among all gauges */
    double *triangle;        /* of W, packed, of order n_used */
    double *z_scale;         /* (n_used) 1 / sqrt(P_ii), 0 where no other gauge checks this one */
    int grouped;             /* whether triangle, z_scale and group are set, which a suspect needs alone */
    size_t *group;           /* (n_used) the first of the gauges from which each cannot be distinguished */
    double chi_square_limit, outlier_threshold;
} MaskedMap;

/* Scratch of masked_map_prepare and masked_map_groups. */
typedef struct {
    int wide;                       /* wide_of_processor() */
    double *first, *second, *third; /* (n_gauges, n_gauges) */
    size_t *order;                  /* (n_gauges) gauges, the missing first */
} Workspace;

/* Hand out the arrays. */
void masked_map_arrays(const Map *map, MaskedMap *masked, Room *room);
void workspace_arrays(const Map *map, Workspace *work, Room *room);

/* Fill masked for the gauges of masked->mask. */
void masked_map_prepare(const Map *map, MaskedMap *masked, Workspace *work);

/* Set the groups of gauges that cannot be distinguished, if they are not. */
void masked_map_groups(const Map *map, MaskedMap *masked, Workspace *work);

#endif
