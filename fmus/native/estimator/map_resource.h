/* The inverse map of an FMU: resources/map.bin, read and checked.

   The file is little endian: a header of HEADER_SIZE bytes, then float64 arrays in the order of Map, each row by row
   unless they are described otherwise. strainfmu/fmu/native_resource.py writes it, docs/explanation/native.md describes
   it. */

#ifndef MAP_RESOURCE_H
#define MAP_RESOURCE_H

#include "../core/resource.h"

#define MAP_FORMAT_VERSION 1
#define N_LOADS 5

/* An inverse map for n_gauges gauges and n_states pressure states; arrays point into the file's bytes.
   Triangles are packed as triangles.h describes; each stands for the matrix of which it is the R of a QR
   decomposition: all that is computed from the two is the same. */
typedef struct {
    size_t n_gauges, n_states;
    int degrees_of_freedom; /* of the residual with all gauges */
    int known_prior;        /* 1 in Case 2: any gauge identifies the state */
    uint32_t checksum;
    const char *guid;
    double reference_area, reference_length, moment_station; /* [m2], [m], [m]: what the map was built with */
    double sensor_range, dynamic_pressure;                   /* start values [1], [Pa] */
    double min_information;                                /* below which gauges do not identify the state */
    double ambiguous_correlation;                            /* above which gauges cannot be distinguished */
    double min_dynamic_pressure;                           /* [Pa], below which there are no coefficients */
    double largest_sensor_range, largest_setting;            /* bounds on what may be set */
    const double *mean_strain;       /* (n_gauges) m */
    const double *load_of_mean;      /* (5) [N, N m] */
    const double *load_gain;         /* (n_gauges, 5) G' of all gauges */
    const double *load_covariance;   /* (5, 5) of all gauges */
    const double *residual_triangle; /* of W */
    const double *gain_triangle;     /* of the W that the gain is made with */
    const double *noise_whitening;   /* L^-1 by rows of its lower triangle */
    const double *noise_root;        /* L by rows of its lower triangle */
    const double *regression;        /* (5, n_gauges) X' L'^-1 */
    const double *remainder;         /* (5, 5) S */
    const double *state_operator;    /* (n_states, n_gauges) A' */
    const double *load_per_state;    /* (n_states, 5) M' */
    const double *min_precision;   /* (n_gauges) P_ii that is round-off */
    const double *chi_square_limit;  /* (n_gauges) by degrees of freedom 1 .. n_gauges */
    const double *outlier_threshold; /* (n_gauges) by number of gauges 1 .. n_gauges */
} Map;

/* Read the header and arrays of bytes [length], which must be aligned as double and outlive map. Return 1, or 0 with
   a text that states what is wrong. */
int map_parse(const unsigned char *bytes, size_t length, Map *map, char text[MODEL_TEXT_SIZE]);

#endif
