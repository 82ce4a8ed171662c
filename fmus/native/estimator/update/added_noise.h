/* What follows from the covariance of the gauges: gains, whitening and covariances of a map. Beside what the file says,
   gauges have errors that do not scale with the dynamic pressure: those of their zeros, and what temperature sensors leave
   of thermal strain.

   The C counterpart of strainfmu/estimator/map/added_noise.py, and of linear/decomposition.py for form "dynamic_pressure". */

#ifndef ADDED_NOISE_H
#define ADDED_NOISE_H

#include "masked_map.h"
#include "noise_state.h"

/* Number of doubles that its arrays take, and handing them out for the map of a file. */
size_t added_noise_doubles(const Map *map);
void added_noise_arrays(const Map *map, AddedNoise *noise, double **doubles);

/* Let map have the matrices for the errors noise->own, in place of the file's if set, and noise->added besides; `masked` and
   `work` are scratch. 0 if the sum is no covariance: map is that of the file then, which is one where this has returned 1
   with neither. */
int added_noise_apply(AddedNoise *noise, Map *map, MaskedMap *masked, Workspace *work);

#endif
