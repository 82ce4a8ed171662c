/* The tables over the flight state, part "flight" of resources/map.bin. strainfmu/estimator/tables/channel_tables.py has
   the formulas. */

#ifndef FLIGHT_MAP_H
#define FLIGHT_MAP_H

#include "container.h"

#define N_STATES 4     /* of the flight state: M [1], u, w [rad], ln(p_inf / Pa) */
#define N_NAVIGATION 3 /* M [1], p_inf [Pa], q_inf [Pa] */
#define MAX_SHAPES 16  /* of pressure off the tables that are tested */
#define N_MEASURED 7   /* M, ln p_inf, ln q_inf of navigation; then the four priors */

enum { STATE_MACH, STATE_U, STATE_W, STATE_PRESSURE };

/* Tables of some rows; arrays point into the bytes of the file. */
typedef struct {
    size_t n_mach, n_incidence; /* knots */
    size_t n_harmonics, n_channels;
    size_t n_rows, n_terms;     /* a row is the sum of one term or two */
    double min_incidence;
    const double *mach_knots, *incidence_knots;
    const double *table;        /* (n_mach + 2, n_incidence + 2, n_channels, n_harmonics) */
    const double *row;          /* (n_terms) that a term adds to, ascending */
    const double *channel;      /* (n_terms) */
    const double *cosine, *sine; /* (n_terms, n_harmonics) factors of cos m phi_T and sin m phi_T */
    const double *fixed;        /* (n_rows) */
} TableMap;

/* Quantities and units: strainfmu/estimator/tables/manifold_map.py. */
typedef struct {
    TableMap tables;            /* of strains, then loads */
    TableMap considered;        /* of strains, then all loads, of a considered error; no rows in maps without */
    size_t n_common;            /* errors that all gauges have in common */
    size_t n_considered_common; /* considered ones of these */
    size_t n_shapes;            /* of pressure off the tables that are tested, at most MAX_SHAPES */
    double reference_area, reference_length;
    double mach_range[2], pressure_range[2], log_pressure_range[2], middle_log_pressure, incidence_limit;
    double has_crossflow_range;                         /* 1, or 0: incidence_limit at every roll angle of the wind */
    double crossflow_middle[2], crossflow_half[2];      /* of the ranges of u and w [rad] */
    double error[N_NAVIGATION]; /* of navigation without a standard deviation: of M [1], relative of p_inf and q_inf */
    double altitude_error;      /* relative, of p_inf by the altitude */
    double chi_square_scale, outlier_scale;
    int has_gain_error;                    /* of any row's own */
    double prior_mean[N_STATES], prior_precision[N_STATES];
    double largest_step[N_STATES];
    double navigation_limit[N_NAVIGATION]; /* standardised residuals above which navigation is inconsistent */
    double navigation_alarm;               /* from which one that is dropped is an alarm */
    double shape_limit;                    /* sum of squares of shapes from which strain does not fit */
    double outlier_threshold;
    double outside_score, range_tolerance;
    double min_gain, min_incidence_score;
    double half_gamma, log_half_gamma;
    double search_every, return_after; /* steps */
    double start_iterations, cold_iterations, warm_iterations; /* the first an even number */
    const double *gain_std, *common_gain;               /* (n_gauges) */
    const double *gauge_covariance, *scaled_covariance; /* (n_gauges, n_gauges) */
    const double *load_strain_covariance;               /* (5, n_gauges) */
    const double *load_covariance;                      /* (5, 5) */
    const double *gauge_error_product;                  /* (21, n_gauges) */
    const double *common_error;                         /* (n_common, 6, n_gauges) */
    const double *shape;                                /* (n_shapes, n_gauges) */
    const double *considered_covariance;                /* (n_gauges, n_gauges) of considered errors, */
    const double *considered_load_strain_covariance;    /* (5, n_gauges), */
    const double *considered_load_covariance;           /* (5, 5), */
    const double *considered_common;                    /* (n_considered_common, 6, n_gauges) */
    const double *chi_square_limit;                     /* (n_gauges + 4) by degrees of freedom from 0 on */
} FlightMap;

/* Read tables of n_rows rows of a part, whose knots are known. 1; 0 with a text. */
int tables_parse(MapFile *file, const char *part, size_t n_rows, TableMap *tables);

/* Read the part of the considered error that has tables of strains and loads, after the part of the tables. 1; 0 with a
   text. */
int considered_parse(MapFile *file, size_t n_gauges, size_t n_loads, FlightMap *map);

/* Read the part for n_gauges gauges. 1; 0 with a text that states what is wrong. */
int flight_map_parse(MapFile *file, size_t n_gauges, FlightMap *map);

#endif
