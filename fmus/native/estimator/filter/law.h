/* The normal laws of a filter's states: what both filters carry from sample to sample.

   The states are those of a stationary process: the first ones with a rate each, which are the last ones, the others fast or
   slow; the last that a sample reads are amplitudes of temperature modes. Errors that are considered are never estimated:
   a law has their covariance with the states. strainfmu/estimator/reference/kalman.py has the equations. */

#ifndef LAW_H
#define LAW_H

#include "../map/flight_map.h"
#include "../temperature/thermal.h"
#include "zero_errors.h"

/* The arrays lie in one block. */
typedef struct {
    double *mean;       /* (order) */
    double *covariance; /* (n, order) */
    double *cross;      /* (n, n_considered) with the considered errors but those of zeros */
    double *of_zeros;   /* (n, zeros.columns) with those of zeros, where such are in use */
    double *zero;       /* (zero_errors_noted) of which zeros those are */
    double *stated;     /* (n_parameters) deviations of flow parameters that are known, 0 of others */
    double *amplitude;  /* (n_modes) of temperature by the sensors of the sample [K] */
    double *known;      /* (n_sensors) which those were, 0 or 1 */
} Law;

/* A step of the process: of a state and its rate by pairs, of the others a factor. */
typedef struct {
    double time_step, time_constant; /* that it belongs to [s] */
    double pair[N_STATES][2][2];
    double *factor;       /* (n) of the states without a rate */
    double of_considered; /* that of the considered errors */
} Motion;

/* The process, its laws, and what the present sample has to do with them. */
typedef struct {
    int wide;
    const Thermal *thermal; /* of the estimator */
    size_t n, order;        /* states; in lanes */
    size_t n_considered;    /* in lanes; errors of zeros are apart */
    size_t n_parameters;    /* of the flow */
    size_t n_modes, n_sensors; /* of temperature */
    size_t n_pairs;         /* states with a rate */
    double rate[N_STATES];  /* of their motion [1/s] */
    size_t first_slow, end_slow; /* the slow states, */
    double slow;                 /* whose time constant is this many times that of the others */
    size_t first_widened, end_widened; /* states whose variance a step may widen */
    ZeroErrors zeros;       /* of the sample, */
    double *stated;         /* (in_lanes(n_parameters)) and deviations of flow parameters */
    Law law, next_law;      /* that a sample starts from, and that it leaves */
    Law predicted, stationary;
    Motion motion;          /* from the law to the predicted one */
} Laws;

/* The first state that is a rate, and the first that is the amplitude of a temperature mode. */
static inline size_t first_rate(const Laws *laws) {
    return laws->n - laws->n_pairs;
}

static inline size_t first_mode(const Laws *laws) {
    return first_rate(laws) - laws->n_modes;
}

/* Number of doubles of a law; that its arrays take; handing them out. All sizes are set. */
size_t law_doubles(const Laws *laws);
size_t laws_doubles(const Laws *laws);
void laws_arrays(Laws *laws, double **doubles);

/* Note in a law zeros, flow parameters and amplitudes of the sample; whether those of laws->law are the same. */
void law_note(const Laws *laws, Law *law);
int laws_hold(const Laws *laws);

/* The law that the sample leaves becomes that to start from; the predicted law becomes the one that it leaves. */
void laws_take_next(Laws *laws);
void laws_keep_predicted(Laws *laws);

/* laws->law in bytes: 0 where there is none, as what it says of zeros where none has a deviation; whether such bytes may be
   read. */
size_t law_state_size(const Laws *laws);
void law_write_state(const Laws *laws, int has_law, unsigned char *bytes);
int law_state_fits(const Laws *laws, const unsigned char *bytes);
void law_read_state(Laws *laws, const unsigned char *bytes);

#endif
