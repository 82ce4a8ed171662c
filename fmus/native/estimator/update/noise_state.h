/* The arrays of a map that follow from the covariance of its gauges, and scratch to make them. */

#ifndef NOISE_STATE_H
#define NOISE_STATE_H

#include "other_loads.h"

/* The arrays of Map and ScaledForm that follow from others. */
typedef struct {
    int wide;        /* panels_wide() */
    Map file;        /* with the arrays of the file alone */
    double *added;   /* (n_gauges, n_gauges) covariance of the other errors [1] */
    const double *own, *whole; /* (n_gauges, n_gauges) covariance of the gauges in place of the file's, and with the
                                  errors that scale; NULL for those of the file */
    double *residual_triangle, *gain_triangle, *noise_whitening, *noise_root; /* as in Map */
    double *load_gain, *load_covariance, *regression, *remainder, *min_precision;
    double *whitening, *singular, *load, *unseen, *form_min_precision; /* as in ScaledForm */
    OtherLoads *other_loads; /* other loads, which follow too; NULL for none */
    double *large;   /* scratch: see added_noise.c */
    double *head;
    double *square[3]; /* (n_gauges, n_gauges) each */
    double *rows;      /* (5, n_gauges + n_states), and n_gauges */
} AddedNoise;

#endif
