/* The matrices of a map for sets of gauges in use, each prepared once and kept; and for the errors that gauges have now. */

#ifndef PREPARED_H
#define PREPARED_H

#include "../map/map_resource.h"
#include "../sample/inputs.h"
#include "added_noise.h"

/* All that a step needs of a map for the gauges in use, computed once per set. Entries are by gauge in use, ascending. */
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

/* Scratch of one set after another. */
typedef struct {
    int wide;                       /* wide_of_processor() */
    double *first, *second, *third; /* (n_gauges, n_gauges) */
    size_t *order;                  /* (n_gauges) gauges, the missing first */
} Workspace;

/* Set the groups of gauges that cannot be distinguished, if they are not. */
void masked_map_groups(const Map *map, MaskedMap *masked, Workspace *work);

/* Sets of missing gauges whose matrices are kept; the least recently used gives way. */
#define CACHED_MASKS 4

typedef struct {
    Map *map;
    AddedNoise noise;  /* errors of the zeros, */
    size_t n_strains;
    double *noise_std; /* (n_strains + 1) the standard deviations that map holds for, */
    double *next_std;  /* and those that matrices are made for */
    MaskedMap *masked; /* for the gauges in use; NULL before any are known */
    MaskedMap cache[CACHED_MASKS];
    unsigned long last_use[CACHED_MASKS], uses; /* 0 for an empty entry */
    Workspace work;
    unsigned char *mask; /* (n_gauges) gauges in use in this step */
} Prepared;

/* Hand out the arrays of a map with n_strains strain gauges; noise.other_loads is set. */
void prepared_arrays(Map *map, size_t n_strains, Prepared *prepared, Room *room);

/* Give the map its matrices, for the errors of its file. 0 if those are no covariance. */
int prepared_begin(Prepared *prepared);

/* Set prepared->masked for the gauges in use. */
void prepared_follow(Prepared *prepared, const Inputs *inputs);

/* Whether the map holds for standard deviations of the zeros, and the common one (n_strains + 1). */
int prepared_holds(const Prepared *prepared, const double *std);

/* Begin to make the matrices for other sigmas, and for noise.own and noise.whole; a part of it, as of added_noise.h. */
void prepared_renew(Prepared *prepared, const double *std);
int prepared_part(Prepared *prepared, size_t work);

/* After the last part: the map has them, and no set of gauges is prepared. */
void prepared_renewed(Prepared *prepared);

#endif
