/* Whether an estimate and its flight state are inside what the snapshots of the map cover.

   The C counterpart of strainfmu/estimator/envelope.py. */

#ifndef ENVELOPE_H
#define ENVELOPE_H

#include "map_resource.h"

/* What is known of the flow in a step. */
typedef struct {
    int known;        /* whether the dynamic pressure gives coefficients */
    double pressure;  /* [Pa] */
    double deviation; /* of its error [Pa]; 0 where it is not known */
    double mach_number, altitude; /* [1], [m]; NaN where not known */
} Flow;

/* Whether dynamic pressure, Mach number or altitude leave their ranges or contradict each other. */
int outside_by_navigation(const Envelope *envelope, const Flow *flow);

/* The largest (n'C - limit) / sigma over the half-spaces, 0 where C is inside all. Coefficients (5) and their covariance
   (5, 5) are those at the references of the map. *worst is the half-space, SIZE_MAX for none. wide as for panels.h. */
double envelope_score(const Envelope *envelope, int wide, const double *coefficients, const double *covariance,
                      size_t *worst);

/* Its derivative, where coefficients and covariance change by these. */
double envelope_score_derivative(const Envelope *envelope, size_t worst, double score, const double *covariance,
                                 const double *d_coefficients, const double *d_covariance);

#endif
