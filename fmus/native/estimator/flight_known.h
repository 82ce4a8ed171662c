/* Further parameters of the flow that are known with a deviation: tables and errors about what is known of them.

   The C counterpart of strainfmu/estimator/manifold/parameter_tables.py; strainfmu/fmu/parameter_tables_resource.py
   writes the section of resources/map.bin. Tables are those of strain on the same knots, plus p_inf times a sum over
   powers of the parameters; errors are products, so that what is known weighs them. */

#ifndef FLIGHT_KNOWN_H
#define FLIGHT_KNOWN_H

#include "flight_tables.h"
#include "map_resource.h"

/* Arrays point into the bytes of the file. */
typedef struct {
    size_t n_parameters, n_powers;
    double largest_score;        /* of a parameter's range by which it may leave it and still be used */
    const double *mean, *spread; /* (n_parameters) over the snapshots; a spread of 0 where they hold one value */
    const double *parameter, *power, *offset; /* (n_powers) ascending parameter, exponent, mean over the snapshots */
    TableMap tables, further;    /* of the mean; further loads, no rows in maps without */
    const double *slope, *further_slope; /* (n_powers, coefficients of the table) per unit of a power */
    const double *product;       /* (known_products, product_size) of errors, per p_inf^2: of those that no parameter
                                    makes; of pairs of powers a <= b of each parameter, both ways; of the spread of each */
} KnownMap;

/* Tables, and products of their errors per p_inf^2. */
typedef struct {
    FlightTables tables, further;
    double *scaled_covariance;       /* (n, n) in lanes */
    const double *load_strain_covariance, *load_covariance;
    const double *further_strain_covariance, *further_variance;
} Errors;

typedef struct {
    int present;  /* whether the map has such tables; if not, nothing else is set */
    int in_use;   /* whether the solver's tables are `own`; those of the mean else */
    KnownMap map;
    Errors mean, own;
    double *value, *std;          /* (n_parameters) that `own` is for, NaN of what is not known, and of all at first */
    double *weight, *shift, *along; /* (n_parameters), (n_powers), (n_powers) scratch */
    CellParts parts, further_parts; /* of the tables of `own`: of the mean, then of each power, weighed by shift */
    double *products;             /* (product_size) of `own` */
} Known;

struct Estimator;

/* Read the section. Return 1, or 0 with a text. */
int known_map_parse(const Section *section, const FlightMap *flight, size_t n_gauges, size_t n_further, KnownMap *map,
                    char text[MODEL_TEXT_SIZE]);

/* Number of doubles that its arrays take, and handing them out, filled in; after those of solver and further loads. */
size_t known_doubles(const KnownMap *map, size_t n_gauges);
void known_arrays(struct Estimator *e, double **doubles);

/* Whether a parameter is known with a deviation, so that the tables follow it; whether any is. */
int parameter_known(const struct Estimator *e, size_t which);
int any_parameter_known(const struct Estimator *e);

/* Let the solver's tables be those about what the inputs know, or those of the mean where they know nothing. */
void known_follow(struct Estimator *e);

/* Let them be those of the mean. */
void known_forget(struct Estimator *e);

#endif
