/* What the estimator puts out for a sample: places of the outputs, states of health, coefficients of loads. */

#ifndef OUTPUTS_H
#define OUTPUTS_H

#include <math.h>

#include "../map/map_resource.h"

/* Indices of the outputs; their numbers are the value references of FMI 2.0. Integers and the health state are whole
   numbers here too. */
enum {
    COEFFICIENTS = 0,      /* C_A, C_N, C_Y, M_P, M_Y [1] */
    COEFFICIENTS_STD = 5,  /* [1] */
    LOADS = 10,            /* axial, normal, side force; pitching, yawing moment [N, N m] */
    LOADS_STD = 15,        /* [N, N m] */
    HEALTH_STATE = 20,
    CHI_SQUARE = 21,       /* [1] */
    CHI_SQUARE_LIMIT = 22, /* [1] */
    VALID_GAUGES = 23,     /* number of gauges in use */
    SUSPECT_GAUGE = 24,    /* the first suspect, from 1; 0 for none */
    SUSPECTS = 25,         /* gauges that share the suspicion */
    ENVELOPE_SCORE = 26,   /* [1] */
    N_OUTPUTS = 27
};

/* States of health: strainfmu/estimator/health.py. */
enum { OK, INCONSISTENT, NO_COEFFICIENTS, INVALID, DEGRADED, UNIDENTIFIED, SUSPECT, OUTSIDE };

/* What may hold of a sample, as bits, and the state of health that each one means; the first one that holds counts: outputs.c.
   Estimators set the bits. */
#define CONDITIONS(X) \
    X(NO_GAUGE, INVALID)                 /* no gauge gives a strain */                                                 \
    X(FILTER_HOLDS, INVALID)             /* the same, and the filter holds the last loads */                           \
    X(NOT_IDENTIFIED, UNIDENTIFIED)      /* the gauges in use do not identify the loads */                             \
    X(PRESSURE_UNKNOWN, NO_COEFFICIENTS) /* no q_inf, or none with a standard deviation: no coefficients */            \
    X(FLOW_OUTSIDE, OUTSIDE)             /* air data, flow parameters or the flight state leave what the map covers */ \
    X(STRAIN_MISFIT, INCONSISTENT)       /* chi-square or discrepancy modes are above their thresholds */              \
    X(ANGLES_CONTRADICT, INCONSISTENT)   /* measured angles are others than by strain */                               \
    X(FORCE_CONTRADICTS, INCONSISTENT)   /* the specific force of the stated mass is another one than the load */      \
    X(GAUGE_MISFIT, SUSPECT)             /* one gauge does not fit the others */                                       \
    X(COEFFICIENTS_OUTSIDE, OUTSIDE)     /* the coefficients leave the envelope of a linear map */                     \
    X(GAUGES_LOST, DEGRADED)                                                                                           \
    X(AIR_DATA_LOST, DEGRADED)           /* an input is left out, with an alarm */                                     \
    X(STATE_MOVES, DEGRADED)             /* the iterations have not come to rest */                                    \
    X(LOADS_OF_LINEAR_MAP, DEGRADED)     /* fall-back of the nonlinear estimator */                                    \
    X(RENEWAL_PENDING, DEGRADED)         /* matrices for other zero offsets are being made */                          \
    X(VIBRATES, DEGRADED)                /* more than the map states */
#define CONDITION_PLACE(condition, state) condition##_PLACE,
#define CONDITION_BIT(condition, state) condition = 1 << condition##_PLACE,
enum { CONDITIONS(CONDITION_PLACE) N_CONDITIONS };
enum { CONDITIONS(CONDITION_BIT) NO_CONDITION = 0 };

/* Names of the states, by number; and the state of the first condition that holds, OK for none. */
extern const char *const HEALTH_NAMES[];
int health_state(int conditions);

/* Whether loads may be used with their stated standard deviations in a state of health. */
static inline int is_usable(double health) {
    return health == (double)OK || health == (double)DEGRADED;
}

/* Factors of coefficients at q_inf [Pa]: 1 / (q S) for the three forces, 1 / (q S L) for the two moments. */
static inline void coefficient_scales(double pressure, double area, double length, double *scale) {
    scale[0] = scale[1] = scale[2] = 1.0 / (pressure * area);
    scale[3] = scale[4] = 1.0 / (pressure * (area * length));
}

/* No number, for outputs from `first` up to, not including, `end`. */
static inline void set_unknown_from(double *output, int first, int end) {
    for (int i = first; i < end; i++) {
        output[i] = NAN;
    }
}

/* Outputs without an estimate: no loads and coefficients, and a residual without terms, whose chi-square and envelope
   margin are 0. Counts and health are the caller's. */
static inline void set_unknown(double *output, double chi_square_limit) {
    set_unknown_from(output, COEFFICIENTS, HEALTH_STATE);
    output[CHI_SQUARE] = output[ENVELOPE_SCORE] = 0.0;
    output[CHI_SQUARE_LIMIT] = chi_square_limit;
}

/* M_P' = M_P + shift F_N and M_Y' = M_Y + shift F_Y about a point further aft. */
static inline void move_moments(double shift, double *loads) {
    loads[3] += shift * loads[1];
    loads[4] += shift * loads[2];
}

/* Variance of moment `load` about the shifted point, and in *with_force its covariance with the force that comes in:
   of B C B' the entries that are needed. */
static inline double moved_variance(const double *covariance, size_t load, double shift, double *with_force) {
    const size_t force = load - 2;
    const double cross = covariance[load * N_LOADS + force], of_force = covariance[force * N_LOADS + force];
    *with_force = cross + shift * of_force;
    return (covariance[load * N_LOADS + load] + shift * cross) + shift * *with_force;
}

/* Linear outputs of a map in form "dynamic_pressure" in addition to the five loads, computed when they are read: part
   "other_loads" of resources/map.bin. */

#define OUTPUT_NAME_SIZE 48

/* Loads of states and errors; the arrays point into the bytes of the file. */
typedef struct {
    MAP_MEMBERS(OTHER_LOADS)
} OtherLoadsMap;

/* Each array of (n_loads). */
enum { OTHER_LOADS, OTHER_LOADS_STD, OTHER_COEFFICIENTS, OTHER_COEFFICIENTS_STD, N_OTHER_VALUES };

typedef struct {
    int present;         /* whether the map has such loads; if not, nothing else is set */
    OtherLoadsMap map;      /* as the file has it */
    double *rows;        /* (2 n_loads, n_gauges) scratch of added_noise.h */
    double *growth;      /* (n_gauges) scratch */
    double *value[N_OTHER_VALUES]; /* (n_loads) [N, N m, 1, 1] */
    size_t n_gauges, n_outputs; /* of all arrays */
    size_t *output;        /* (n_outputs) place of each in value[0] and what follows it */
    size_t *array_start;   /* (n_arrays) number of its first output */
    int outdated;
} OtherLoads;

/* Read the part, if there is one, and allocate. 1; 0 after a message. */
int other_loads_create(MapFile *file, size_t n_gauges, OtherLoads *other_loads);

#endif
