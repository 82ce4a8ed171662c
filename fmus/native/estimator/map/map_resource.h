/* The inverse map of an FMU as the linear estimator has it, of the arrays of resources/map.bin: parts "linear", "settings",
   "envelope", "scaled", "scaled_errors". strainfmu/estimator/resource/map_file.py names them, docs/developers/native.md
   describes them. */

#ifndef MAP_RESOURCE_H
#define MAP_RESOURCE_H

#include "../../core/atmosphere.h"
#include "container.h"

#define N_LOADS 5
#define N_PAIRS 21 /* products c_a c_b, a <= b, of c = [1, the five coefficients] */

/* Half-spaces of the coefficients n'C <= limit, and ranges of the flight state:
   strainfmu/estimator/map/envelope.py. */
typedef struct {
    size_t n_half_spaces;
    double score_limit; /* standard deviations beyond a half-space that count as outside */
    double dynamic_pressure[2], mach_number[2], altitude[2]; /* smallest, largest [Pa], [1], [m]; may be infinite */
    double half_gamma;         /* q = half_gamma M^2 p(h) */
    double pressure_tolerance; /* relative difference of the two that is no contradiction */
    Atmosphere atmosphere;     /* p(h) */
    const double *limit;       /* (n_half_spaces) */
    const double *direction;   /* (5, n_half_spaces) */
} Envelope;

/* What scales with the pressure ratio, and what does not: docs/explanation/dynamic_pressure.md and
   strainfmu/estimator/map/proportional_errors.py. In form "absolute" the ratio is 1, and all errors are noise. */
typedef struct {
    int follows_pressure;       /* whether the form is "dynamic_pressure"; 0 in form "absolute" */
    size_t n_free;              /* free states, which are the first directions, */
    size_t n_fixed;             /* and directions of whose loads none follow the ratio: all in form "absolute" */
    size_t n_columns;           /* columns of spread that are not 0, the first ones */
    size_t n_terms;             /* errors that all gauges have in common */
    int has_errors;             /* whether errors follow the current strain */
    double min_expected_ratio;  /* smallest expected chi-square over its degrees of freedom */
    const double *whitening;    /* (n_gauges, n_gauges) V', a row for each gauge; this and the next ones by added_noise.h */
    const double *singular;     /* (n_gauges) S */
    const double *load;         /* (n_gauges, 5) loads of each direction; the gain of each in form "absolute", */
    const double *noise_left;   /* (n_gauges, 5) and what noise and prior leave of the loads by that gain: */
    const double *prior_left;   /* both of form "absolute" alone */
    const double *unseen;       /* (5, 5) R */
    const double *min_precision; /* (n_gauges) P_ii that is round-off */
    const double *fixed_strain; /* (n_gauges) d_0 */
    const double *mean_strain;  /* (n_gauges) m - d_0, at the nominal dynamic pressure */
    const double *fixed_load;   /* (5) f_0 */
    const double *load_of_mean; /* (5) f_mean - f_0 */
    const double *spread;        /* (n_gauges, n_gauges) N of what has a prior, N N' the sum over its columns */
    const double *spread_load;   /* (n_gauges, 5) loads of its columns, */
    const double *spread_unseen; /* (5, 5) and what those columns do not hold */
    const double *of_gauge;      /* (21, n_gauges) sums of D_a D_b; this and the rest only with has_errors */
    const double *mean_product;  /* (21) of c_a c_b */
    const double *common;        /* (n_terms, 6, n_gauges) E */
} ScaledForm;

/* An inverse map for n_gauges gauges and n_states pressure states; arrays point into the file's bytes, those that follow
   from others into memory that added_noise.h fills.
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
    double min_dynamic_pressure, max_dynamic_pressure;       /* [Pa], beyond which there are no coefficients */
    double dynamic_pressure_error;                           /* relative, where no standard deviation is given [1] */
    double chi_square_scale, outlier_scale;                  /* factors on the limits of chi-square and of z^2 */
    double level_slope;                                      /* by which they rise with expected chi-square besides [1] */
    double smallest_setting, largest_setting;                /* bounds on what may be set */
    double largest_zero;                                     /* the same for zeros and their standard deviations [1] */
    double not_known; /* start value of parameters of the flow, and a value of thrust, that means what NaN does */
    const double *mean_strain;       /* (n_gauges) m */
    const double *load_of_mean;      /* (5) [N, N m] */
    const double *residual_triangle; /* of W; this and the next two by added_noise.h */
    const double *noise_whitening;   /* L^-1 by rows of its lower triangle */
    const double *min_precision;     /* (n_gauges) P_ii that is round-off */
    const double *state_operator;    /* (n_states, n_gauges) A' */
    const double *load_per_state;    /* (n_states, 5) M' */
    size_t n_errors;
    const double *gauge_covariance;  /* (n_gauges, n_gauges) Gamma_g */
    const double *error_strain;      /* (n_errors, n_gauges) N' */
    const double *error_load;        /* (n_errors, 5) N_f' */
    const double *chi_square_limit;  /* (n_gauges) by degrees of freedom 1 .. n_gauges */
    const double *outlier_threshold; /* (n_gauges) by number of gauges 1 .. n_gauges */
    double regularisation;           /* gamma */
    Envelope envelope;
    ScaledForm form;
    double incidence_per_force; /* at the largest incidence, over the lateral coefficient [rad]; 0 where not known */
    int has_tables, has_filter, has_known; /* whether there are tables over the flight state, a filter, and tables over
                                              other parameters of the flow */
} Map;

/* p(h) [Pa]; NaN where h is not known or outside the atmosphere. */
double ambient_pressure(const Envelope *envelope, double altitude);

/* Read a file that map_open has checked; the arrays of what not every map has stay for others. 1; 0 with a text. */
int map_parse(MapFile *file, Map *map);

#endif
