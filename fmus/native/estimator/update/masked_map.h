/* All that a step needs of a map for the gauges that are in use: computed once per set of gauges.

   docs/explanation/theory.md has the formulas, strainfmu/estimator/reference/update.py the equations. */

#ifndef MASKED_MAP_H
#define MASKED_MAP_H

#include "../map/map_resource.h"

/* Entries are by gauge in use, ascending. */
typedef struct {
    unsigned char *mask; /* (n_gauges) 1 for the gauges in use */
    size_t n_used;
    int identified;          /* whether they identify the state; if not, what follows is not set */
    size_t *used;            /* (n_used) their indices among all gauges */
    double *mean_strain;     /* (n_used) */
    double *load_gain;       /* (n_used, LOAD_STRIDE); this and load_covariance of form "absolute" alone */
    double *triangle;        /* of W, packed, of order n_used */
    double *row_panels;      /* its rows as panels.h lays them out */
    double *column_panels;   /* its columns */
    double *z_scale;         /* (n_used) 1 / sqrt(P_ii), 0 where no other gauge checks this one */
    float *screen;           /* columns of the triangle times z_scale, in panels */
    int screened;            /* whether screen is set */
    int grouped;             /* whether triangle, z_scale and group are set: those of form "dynamic_pressure" when needed */
    size_t *group;           /* (n_used) the first of the gauges from which each cannot be distinguished */
    double load_covariance[N_LOADS * N_LOADS];
    double load_std[N_LOADS], load_std_shift; /* about the moment point shifted so [m]; NaN before any is known */
    double chi_square_limit, outlier_threshold;
} MaskedMap;

/* Distance of the gains of two gauges: five loads and a zero, for pairs of doubles. */
#define LOAD_STRIDE 6

/* Scratch of masked_map_prepare. */
typedef struct {
    int wide;                       /* panels_wide() */
    double *first, *second, *third; /* (n_gauges, n_gauges) */
    double *rows;                   /* (5, n_gauges + n_states) */
    size_t *order;                  /* (n_gauges) gauges, the missing first */
} Workspace;

/* Number of doubles and of indices that the arrays of one MaskedMap or Workspace take. */
size_t masked_map_doubles(const Map *map);
size_t masked_map_indices(const Map *map);
size_t workspace_doubles(const Map *map);

/* Hand out arrays from *doubles and *indices, which move on; mask is set by the caller. */
void masked_map_arrays(const Map *map, MaskedMap *masked, double **doubles, size_t **indices);
void workspace_arrays(const Map *map, Workspace *work, double **doubles, size_t **indices);

/* Fill masked for the gauges of masked->mask. */
void masked_map_prepare(const Map *map, MaskedMap *masked, Workspace *work);

/* Set the groups of gauges that cannot be distinguished, if they are not. */
void masked_map_groups(const Map *map, MaskedMap *masked, Workspace *work);

/* Set the covariance of the loads from the gain of the gauges in use, term by term. */
void masked_load_covariance(const Map *map, MaskedMap *masked, const Workspace *work);

#endif
