/* Whether an estimate and its flight state are inside what the snapshots of the map cover.

   the ranges of strainfmu/estimator/map/validity.py. */

#ifndef ENVELOPE_H
#define ENVELOPE_H

#include "../map/map_resource.h"

/* What is known of the flow in a step. */
typedef struct {
    int known;        /* whether the dynamic pressure gives coefficients */
    double pressure;  /* [Pa] */
    double deviation; /* of its error [Pa]; 0 where it is not known */
    double mach_number, altitude; /* [1], [m]; NaN where not known */
    double mach_deviation; /* stated, of the Mach number [1]; 0 for none */
} Flow;

/* Whether dynamic pressure, Mach number or altitude leave their ranges or contradict each other. */
int outside_by_navigation(const Envelope *envelope, const Flow *flow);

/* What an estimator holds of the half-spaces. */
typedef struct {
    double *products; /* (n_half_spaces, 15) n_i n_j, doubled off the diagonal, in panels of dense.h */
    double *variance; /* (dense_rows(n_half_spaces)) scratch */
} HalfSpaces;

/* Hand out the arrays, filled in. */
void half_space_arrays(const Envelope *envelope, HalfSpaces *spaces, Room *room);

/* The largest (n'C - limit) / sigma over the half-spaces, 0 where C is inside all. Coefficients (5) and their covariance
   (5, 5) are those at the references of the map. wide as for wide.h. */
double envelope_score(const Envelope *envelope, const HalfSpaces *spaces, int wide, const double *coefficients,
                      const double *covariance);

#endif
