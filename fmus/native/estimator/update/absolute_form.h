/* The step of a map in form "absolute": the gain is fixed, and so is the covariance of the loads. */

#ifndef ABSOLUTE_FORM_H
#define ABSOLUTE_FORM_H

#include "masked_map.h"

/* Numbers of the last step, by gauge in use. */
typedef struct {
    double *residual;     /* (n_gauges) */
    double *z, *whitened; /* (panel_length(n_gauges)) */
    float *narrow;        /* (n_gauges) whitened */
    double chi_square;
    double loads[N_LOADS]; /* about the map's moment point */
} AbsoluteStep;

/* Number of doubles that its arrays take, and handing them out; narrow is set by the caller. */
size_t absolute_doubles(const Map *map);
void absolute_arrays(const Map *map, AbsoluteStep *step, double **doubles);

/* Condition the loads on the strains (n_gauges) of the gauges in use, which identify the state. wide as for panels.h. */
void absolute_condition(const Map *map, int wide, const MaskedMap *masked, const double *strain, AbsoluteStep *step);

/* z of the last step less its scale, masked->z_scale. */
void absolute_standardised_residuals(int wide, const MaskedMap *masked, AbsoluteStep *step);

#endif
