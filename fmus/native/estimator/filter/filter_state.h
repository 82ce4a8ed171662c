/* What the nonlinear estimator's filter over time holds: the law of its states, a step of it, and a sample.

   The equations are those of strainfmu/estimator/reference/flight_filter.py and kalman.py.
   States are (x, b, c, e, dx/dt), the reference's with the rates last: strain and navigation do not read them.
   Arrays over gauges have `gauges` elements, n_gauges in lanes; rows of a sample are gauges, navigation, and zeros. */

#ifndef FILTER_STATE_H
#define FILTER_STATE_H

#include "../map/filter_map.h"
#include "../nonlinear/solver_state.h"
#include "law.h"

#define FIRST_NAVIGATION N_STATES /* states b, then c */
#define FIRST_SEEN (N_STATES + N_NAVIGATION)

/* Errors of pressure: arrays as in FilterMap, but for rest (rows, rows) of rest_strain. And such as follow what is known. */
typedef struct {
    const double *strain, *load, *rest, *rest_load, *rest_cross, *other_load, *other_cross, *other_variance;
} SeenErrors;

typedef struct {
    double *strain, *load, *rest, *rest_load, *rest_cross, *other_load, *other_cross, *other_variance;
} LeftErrors;

/* What a step leaves to the next one, beside the law and the track of flight.h; all of it float64, as serialised. */
typedef struct {
    double has_law;              /* 0 or 1 */
    double time;                 /* of the sample of the law [s] */
    double now;                  /* of the sample that follows [s] */
    double mean, steps, widening; /* consistency.py */
    double apart[N_NAVIGATION], alarms[N_NAVIGATION]; /* named_navigation.py */
    double slope_state[N_STATES]; /* flight state at which the last step took slopes, */
    double slope_age;             /* and the time over which it has followed the estimated one [s] */
} FilterTrack;

typedef struct {
    int present; /* whether the map has one; if not, nothing else is set */
    FilterMap map;
    FlightSolver *solver;
    Laws laws;              /* the cross covariance of the predicted law is there after laws_move_cross alone */
    size_t n_read, first_e; /* states that a sample reads, and the first of e */
    size_t gauges, rows;    /* n_gauges in lanes; those and navigation in lanes */
    size_t n_terms;               /* considered errors of a gauge; a law has them by term and gauge */
    double time_constant;         /* [s] */
    FilterTrack base, next;       /* that the outputs follow from, and that they leave */
    Law found;                 /* of the solution: one of these, wherever it is kept */
    double slope_state[N_STATES]; /* flight state at which the step takes slopes, */
    Response slope_response;      /* and the tables there */
    double *noise, *rest;      /* (rows, rows) of the map */
    SeenErrors errors, of_map; /* of the sample; where no flow parameter is known, */
    LeftErrors left;           /* and where one is, of the products of a round */
    double round;
    double *along, *amplitude;      /* (n_seen, gauges) amplitudes per strain, and scratch, */
    double *amplitude_root;         /* (n_seen, n_seen), */
    double *other_by_seen;        /* (n_seen, n_other) of filter_known.c */
    /* Scratch: a sample. The flight state is x = mean + L xi, of a standard normal xi. Given it, what else is read has a
       covariance that no iteration changes; other states have what x does not tell of them. */
    double given[N_NAVIGATION]; /* precision of navigation, before any of it is left out */
    double doubt[N_NAVIGATION]; /* factors on its variance while another quantity is dropped */
    double scale[N_NAVIGATION]; /* 1 over the deviation of navigation; 0 where not known */
    double root[N_STATES][N_STATES]; /* L */
    double *read;        /* (order, rows) H' */
    double *term;        /* (n_terms, gauges) considered errors */
    double *white;       /* (rows, rows) upper triangle of the covariance of what is independent, and of the considered
                            errors; of gauges its L after the loads */
    double *considered;  /* (order, rows) C G': of xi, then of the other states given x */
    double *by_state;    /* (N_STATES, order) covariance of xi with the states; then a row of the others' means */
    double *by_row;      /* (N_STATES, rows) the same with what is read but for H x; then a row of its means */
    double *others;      /* (n - N_STATES, order) covariance of the others given x */
    double *gain;        /* (order, rows) its product with H', and considered */
    double *gain_turned; /* (rows, order - N_STATES) its transpose */
    double *spread;      /* (rows, rows) covariance of what is read given x; its L */
    double *inverse;     /* (rows, rows) L^-1, of the same */
    double *innovation;  /* (rows) what strain and navigation read beside the prediction */
    double *right;       /* (rows, N_COLUMNS) columns of xi that are read */
    double *white_right; /* (rows, N_COLUMNS) L^-1 of them, and of the innovation */
    double xi_mean[N_STATES], xi_inverse_root[N_STATES][N_STATES]; /* after the sample: mean; the inverse of the root of
                                                                      its precision */
    double *of_states;   /* (N_STATES, order) root of the part of the covariance after that x has */
    double *whitened;    /* (rows, row_whitened) L^-1 of gain_turned; behind it of what x and the innovation add */
    size_t row_whitened;
    double *kalman;      /* (n + N_STATES + 1, rows) K, S^-1 (..), S^-1 times the innovation */
    double *squares;     /* (rows) diagonal of S^-1 */
    double *product;     /* (order, rows) scratch, */
    double *turned;      /* (rows or order, order), */
    double *kept;        /* (order, order) K H, */
    double *joseph;      /* (3, order, order), */
    double *strip;       /* (n, WIDE_COLUMNS), */
    double *other_turned;   /* (n_other, rows), */
    double *other_by_state; /* (2, order) of filter_other_loads.c */
} Filter;

/* What row m of navigation reads of its lasting error, the only one that reads it. */
static inline double filter_navigation_read(const Filter *filter, size_t m) {
    return filter->read[(FIRST_NAVIGATION + m) * filter->rows + filter->gauges + m];
}

#endif
