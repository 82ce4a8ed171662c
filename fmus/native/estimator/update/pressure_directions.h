/* The directions of a map that serve every dynamic pressure, for the errors of its gauges; scratch to make them part by part. */

#ifndef PRESSURE_DIRECTIONS_H
#define PRESSURE_DIRECTIONS_H

#include "../numerics/orthogonal_rows.h"
#include "other_loads.h"

typedef struct {
    int wide;        /* wide_of_processor() */
    Map file;        /* with the arrays of the file alone */
    double *added;   /* (n_gauges, n_gauges) covariance of the other errors [1] */
    const double *own, *whole; /* (n_gauges, n_gauges) covariance of the gauges instead of the file's, and with the
                                  errors that scale; NULL for the file's */
    OtherLoads *other_loads; /* other loads, which follow too; NULL for none */
    NoiseMatrices set[2], *made; /* the map's, and the ones that are made */
    int stage;       /* of the functions in added_noise.c */
    int refused;     /* whether own and added were no covariance: they are the file's then */
    Turned turned;   /* of pressure_directions.c, */
    size_t taken;    /* and the directions that it has taken */
    double *large;   /* scratch: see added_noise.c */
    double *head;
    double *square;    /* (n_gauges, n_gauges) */
    double *rows;      /* of gain and loads of form "absolute" */
} AddedNoise;

/* The covariance of the gauges' own errors in entry k. */
static inline double own_covariance(const AddedNoise *noise, size_t k) {
    return (noise->own != NULL ? noise->own : noise->file.gauge_covariance)[k] + noise->added[k];
}

/* Number of doubles of noise->large that it needs. */
size_t pressure_directions_doubles(const Map *map);

/* Make the arrays of ScaledForm and OtherLoads that follow from others, part by part. The first one returns 0 if the
   covariance of the gauges is none; the others 1 where they have come to their ends, by parts of about `work`
   multiplications. */
int pressure_directions_begin(AddedNoise *noise);
int pressure_directions_turn(AddedNoise *noise, size_t work);
int pressure_directions_take(AddedNoise *noise, size_t work);

#endif
