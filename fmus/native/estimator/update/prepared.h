/* The matrices of a map for sets of gauges in use, each prepared once and kept; and for the errors that gauges have now. */

#ifndef PREPARED_H
#define PREPARED_H

#include "../sample/inputs.h"
#include "added_noise.h"
#include "masked_map.h"

/* Sets of missing gauges whose matrices are kept; the least recently used gives way. */
#define CACHED_MASKS 4

typedef struct {
    Map *map;
    AddedNoise noise;  /* errors of the zeros, */
    double *noise_std; /* (n_strains + 1) the deviations that map holds for */
    MaskedMap *masked; /* for the gauges in use; NULL before any are known */
    MaskedMap cache[CACHED_MASKS];
    unsigned long last_use[CACHED_MASKS], uses; /* 0 for an empty entry */
    Workspace work;
    unsigned char *mask; /* (n_gauges) gauges in use in this step */
} Prepared;

/* Number of doubles, of indices and of bytes that the arrays take of a map with n_strains strain gauges, and handing them
   out. */
size_t prepared_doubles(const Map *map, size_t n_strains);
size_t prepared_indices(const Map *map);
size_t prepared_bytes(const Map *map);
void prepared_arrays(Map *map, size_t n_strains, Prepared *prepared, double **doubles, size_t **indices,
                     unsigned char **bytes);

/* Give the map its matrices, for the errors of its file. 0 if those are no covariance. */
int prepared_begin(Prepared *prepared);

/* Set prepared->masked for the gauges in use. */
void prepared_follow(Prepared *prepared, const Inputs *inputs);

/* Give the map its matrices for deviations of the zeros, and that in common (n_strains + 1). Whether any are others than
   before, or `other` is true: noise.own and noise.whole are. */
int prepared_renew(Prepared *prepared, const double *std, size_t n_strains, int other);

#endif
