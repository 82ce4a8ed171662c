/* What follows from the covariance of the gauges, in addition to the file's errors by those that do not scale with the
   dynamic pressure: of zeros, and what temperature sensors leave of thermal strain. */

#ifndef ADDED_NOISE_H
#define ADDED_NOISE_H

#include "../numerics/triangles.h"
#include "../sample/outputs.h"

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
    Turned turned;   /* of the directions, */
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

/* Hand out the arrays for the map of a file; other_loads is set. */
void added_noise_arrays(const Map *map, AddedNoise *noise, Room *room);

/* Make the matrices for the errors noise->own, instead of the file's if set, and noise->added besides, part by part; those
   that the map has stay until they are handed out. A part takes about as many multiplications as the first one, or `work`
   of those whose number is not known before. 1, and nothing is done, after the last part. Where the sum is no covariance, the file's is in its
   place, from the first part on. */
void added_noise_begin(AddedNoise *noise);
int added_noise_part(AddedNoise *noise, size_t work);

/* After the last part: the map has them. 0 if the sum was no covariance, and with the file's the map stays as it is if
   that is none. */
int added_noise_hand_out(AddedNoise *noise, Map *map);

#endif
