/* The inverse map of an FMU as the linear estimator has it, of the arrays of resources/map.bin: parts "linear", "settings",
   "envelope", "scaled", "scaled_errors". strainfmu/estimator/resource/map_file.py names them, docs/developers/native.md
   describes them. */

#ifndef MAP_RESOURCE_H
#define MAP_RESOURCE_H

#include "../../core/atmosphere.h"
#include "container.h"

#define N_LOADS 5
#define N_PAIRS 21 /* products c_a c_b, a <= b, of c = [1, the five coefficients] */

/* Half-spaces of the coefficients n'C <= limit, and ranges of the flight state, which may be infinite. */
typedef struct {
    Atmosphere atmosphere; /* p(h), of the layers */
    MAP_MEMBERS(ENVELOPE)
} Envelope;

/* What scales with the pressure ratio, and what does not: docs/explanation/dynamic_pressure.md and
   strainfmu/estimator/reference/linear.py. In form "absolute" the ratio is 1, and all errors are noise. */
typedef struct {
    size_t n_free;              /* free states, which are the first directions, */
    size_t n_fixed;             /* and directions of whose loads none follow the ratio: all in form "absolute" */
    size_t n_columns;           /* columns of spread that are not 0, the first ones */
    int has_errors;             /* whether errors follow the current strain: the members of SCALED_ERRORS are set */
    MAP_MEMBERS(SCALED)
    MAP_MEMBERS(SCALED_ERRORS)
} ScaledForm;

/* What follows from the covariance of the gauges, which added_noise.h makes. */
typedef struct {
    double *residual_triangle;         /* of W */
    double *noise_whitening;           /* L^-1 by rows of its lower triangle */
    double *min_precision;             /* (n_gauges) P_ii that is round-off */
    double *whitening;                 /* (n_gauges, n_gauges) V', a row for each gauge */
    double *singular;                  /* (n_gauges) S */
    double *load;                      /* (n_gauges, 5) loads of each direction; the gain of each in form "absolute", */
    double *noise_left, *prior_left;   /* (n_gauges, 5) and what noise and prior leave of the loads by it: in that form alone */
    double *unseen;                    /* (5, 5) R */
    double *form_min_precision;        /* (n_gauges) as min_precision, by the errors that do not scale */
    double *other_load, *other_unseen; /* (n_gauges, n_loads), (n_loads) the same of loads in addition to the five */
} NoiseMatrices;

/* An inverse map for n_gauges gauges and n_states pressure states; arrays point into the file's bytes.
   Triangles are packed as triangles.h describes; each stands for the matrix of which it is the R of a QR
   decomposition: all that is computed from the two is the same. */
typedef struct {
    uint32_t checksum;
    const char *guid;
    MAP_MEMBERS(LINEAR)
    MAP_MEMBERS(SETTINGS)
    MAP_MEMBERS(ANGLES) /* 0 where not known */
    const NoiseMatrices *made;
    Envelope envelope;
    ScaledForm form;
    int has_tables, has_filter, has_known; /* whether there are tables over the flight state, a filter, and tables over
                                              other parameters of the flow */
} Map;

/* p(h) [Pa]; NaN where h is not known or outside the atmosphere. */
double ambient_pressure(const Envelope *envelope, double altitude);

/* Read a file that map_open has checked; the arrays of what not every map has stay for others. 1; 0 with a text. */
int map_parse(MapFile *file, Map *map);

/* The tables over the flight state, part "flight" of resources/map.bin. strainfmu/estimator/resource/compact_tables.py has
   the formulas. */

#define N_STATES 4     /* of the flight state: M [1], u, w [rad], ln(p_inf / Pa) */
#define N_NAVIGATION 3 /* M [1], p_inf [Pa], q_inf [Pa] */
#define MAX_SHAPES 16  /* discrepancy modes that are tested: the largest length of flight.shapes */
#define N_MEASURED 7   /* M, ln p_inf, ln q_inf of navigation; then the four priors */

enum { STATE_MACH, STATE_U, STATE_W, STATE_PRESSURE };

/* Tables of some rows; arrays point into the bytes of the file. A row is the sum of one term or two. */
typedef struct {
    size_t n_rows;
    MAP_MEMBERS(KNOTS)
    MAP_MEMBERS(TABLES)
} TableMap;

/* Quantities and units: strainfmu/estimator/map/nonlinear_map.py. */
typedef struct {
    TableMap tables;     /* of strains, then loads */
    TableMap considered; /* of strains, then all loads, of a considered error; no rows in maps without */
    int has_gain_error;  /* of any row's own */
    MAP_MEMBERS(FLIGHT)
} FlightMap;

/* Read tables of n_rows rows of a part, whose knots are known. 1; 0 with a text. */
int tables_parse(MapFile *file, const char *part, size_t n_rows, TableMap *tables);

/* Read the part of the considered error that has tables of strains and loads, after the part of the tables. 1; 0 with a
   text. */
int considered_parse(MapFile *file, size_t n_gauges, size_t n_loads, FlightMap *map);

/* Read the part for n_gauges gauges. 1; 0 with a text that states what is wrong. */
int flight_map_parse(MapFile *file, size_t n_gauges, FlightMap *map);

#endif
