/* The nonlinear estimator's filter over time: the law of its states, a step of it, and a sample.

   The C counterpart of strainfmu/estimator/filter: kalman.py, motion.py, flight_model.py, flight_step.py,
   consistency.py. States are (x, b, c, e, dx/dt), numpy's with the rates last: strain and navigation do not read them.
   Arrays over gauges have `gauges` elements, n_gauges in lanes; rows of a sample are gauges, navigation, and zeros. */

#ifndef FILTER_H
#define FILTER_H

#include "filter_map.h"
#include "flight_solve.h"
#include "products.h"

#define FIRST_NAVIGATION N_STATES /* states b, then c */
#define FIRST_SEEN (N_STATES + N_NAVIGATION)

/* The normal law of the states, and their covariance with the errors that are considered, of each gauge its terms. The
   arrays lie in one block. */
typedef struct {
    double *mean;       /* (order) */
    double *covariance; /* (n, order) */
    double *cross;      /* (n, n_considered) by term and gauge */
} Law;

/* What a step leaves to the next one, beside the law and the track of flight.h; all of it float64, as serialised. */
typedef struct {
    double has_law;              /* 0 or 1 */
    double time;                 /* of the sample of the law [s] */
    double now;                  /* of the sample that follows [s] */
    double mean, steps, widening; /* consistency.py */
} FilterTrack;

typedef struct {
    int present; /* whether the map has one; if not, nothing else is set */
    FilterMap map;
    FlightSolver *solver;
    size_t n, order;        /* states; n in lanes */
    size_t n_read, first_e; /* states that a sample reads, and the first of e */
    size_t gauges, rows;    /* n_gauges in lanes; those and navigation in lanes */
    size_t n_terms, n_considered; /* of a gauge; of all */
    double time_constant;         /* [s] */
    double rate[N_STATES];        /* standard deviations of the rates for it */
    FilterTrack base, next;       /* that the outputs follow from, and that they leave, */
    Law law, next_law;            /* with their laws */
    Law predicted, stationary;
    Law found;                    /* of the solution: one of these, wherever it is kept */
    /* Scratch: a sample about a state. */
    double scale[N_NAVIGATION]; /* 1 over the deviation of navigation; 0 where not known */
    double *read;      /* (order, rows) H' */
    double *term;      /* (n_terms, gauges) considered errors */
    double *white;     /* (rows, rows) covariance of what is independent, and of the considered errors */
    double *white_factor; /* (rows, rows) its L */
    double *considered;   /* (order, rows) C G' */
    double *fixed_gain;   /* (order, rows) P H' + C G' but for the Jacobian by the flight state */
    double *fixed_spread; /* (rows, rows) H P H' + .. but for the same; its upper triangle */
    double *fixed_value;  /* (rows) strain and navigation of the states but the flight state */
    double *innovation;   /* (rows) what strain and navigation read beside the prediction */
    double *gain;         /* (order, rows) P H' + C G'; then the innovation */
    double *spread;       /* (rows, rows) its L after a decomposition */
    double *inverse, *inverse_turned; /* (rows, rows) L^-1, and its transpose */
    double *whitened;     /* (order, rows) of each row of gain L^-1 */
    double *kalman;       /* (order, rows) K; then S^-1 times the innovation */
    double *squares;      /* (rows) diagonal of S^-1 */
    double *product;      /* (order, rows) scratch, */
    double *turned;       /* (rows or order, order), */
    double *kept;         /* (order, order) I - K H, */
    double *joseph;       /* (2, order, order) */
    double *further_turned;   /* (n_further, rows), */
    double *further_by_state; /* (2, order) of filter_further.c */
} Filter;

/* Fill in the sizes, and how many doubles it takes; handing them out. */
size_t filter_doubles(Filter *filter, FlightSolver *solver);
void filter_arrays(Filter *filter, double **doubles);

/* Forget all steps. */
void filter_reset(Filter *filter);

/* Number of doubles of a law. */
size_t law_doubles(const Filter *filter);

/* Set the time constant [s]; the law of which nothing has been measured follows, in filter->stationary. */
void filter_set_time_constant(Filter *filter, double time_constant);

/* filter->predicted from filter->law, over a time step [s]. */
void filter_predict(Filter *filter, double time_step);

/* Estimate solver->sample from a predicted law, by iterations from a flight state: the solution in solver->solution, the
   law after it in filter->next_law. */
void filter_sample(Filter *filter, const Law *law, const double *start, size_t iterations);

/* Gains of the first `count` states, and the decomposition of the spread. For the next. */
void filter_set_gain(Filter *filter, const Law *law, size_t count);

/* The law after a sample whose rows are set; then the flight state gets a value, from which the others follow by their
   covariance: its square distance. For filter_sample.c. */
void filter_update_law(Filter *filter, const Law *law, Law *after);
double filter_give(Filter *filter, Law *law, const double *state);

/* solver->solution at the law in filter->next_law, the last sample's. For filter_sample.c. */
void filter_solution(Filter *filter);

/* What the gauges in use read beside all states of a law, (rows) in filter->product. */
double *filter_left(Filter *filter, const Law *law);

/* The outputs in estimator->further for the law of the last update. */
struct Estimator;
void filter_further_update(struct Estimator *e);

/* One more normalised innovation, of so many degrees of freedom. */
void filter_note(Filter *filter, double chi_square, double degrees_of_freedom);

#endif
