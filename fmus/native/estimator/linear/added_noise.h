/* A map whose gauges err otherwise than the file says, in ways that do not scale with the dynamic pressure: errors of
   their zeros, and what temperature sensors leave of thermal strain. Gains, whitening and covariances follow.

   The C counterpart of strainfmu/estimator/map/added_noise.py, and of linear/decomposition.py for form "dynamic_pressure". */

#ifndef ADDED_NOISE_H
#define ADDED_NOISE_H

#include "further_loads.h"
#include "masked_map.h"

/* What takes the place of the arrays of the file. */
typedef struct {
    Map original;    /* as the file has it */
    double *added;   /* (n_gauges, n_gauges) covariance of the further errors [1] */
    const double *own, *whole; /* (n_gauges, n_gauges) covariance of the gauges in place of the file's, and with the
                                  errors that scale; NULL for those of the file */
    double *residual_triangle, *gain_triangle, *noise_whitening, *noise_root; /* as in Map */
    double *load_gain, *load_covariance, *regression, *remainder, *min_precision;
    double *whitening, *singular, *load, *unseen, *form_min_precision; /* as in ScaledForm */
    Further *further; /* further loads, which follow too; NULL for none */
    double *large;   /* scratch: see added_noise.c */
    double *head;
    double *square[3]; /* (n_gauges, n_gauges) each */
    double *rows;      /* (5, n_gauges + n_states) */
} AddedNoise;

/* Number of doubles that its arrays take, and handing them out for the map of a file. */
size_t added_noise_doubles(const Map *map);
void added_noise_arrays(const Map *map, AddedNoise *noise, double **doubles);

/* Let map be that of the file with the errors noise->own, if set, and noise->added besides; `masked` and `work` are
   scratch. With neither it is that of the file to the bit. 0, and map is that of the file, if the sum is no covariance. */
int added_noise_apply(AddedNoise *noise, Map *map, MaskedMap *masked, Workspace *work);

#endif
