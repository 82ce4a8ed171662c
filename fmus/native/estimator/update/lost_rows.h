/* Gauges that are lost: the others predict them, so that the directions of all gauges stay. */

#ifndef LOST_ROWS_H
#define LOST_ROWS_H

#include "../sample/outputs.h"
#include "prepared.h"

#define N_VALUES 16 /* the 15 entries of a covariance row by row, and a zero */

/* Intervals of the pressure ratio that are kept: a factor 2 of dynamic pressure; and the points in each. */
#define CACHED_INTERVALS 16
#define N_NODES 6

/* Numbers of one interval of the pressure ratio, with all gauges. They depend on nothing else, so that keeping them changes
   no result. */
typedef struct {
    double below, above;     /* its ends; NaN before it is known */
    double *factor;          /* of errors in proportion to strain: current_errors.c, (16 and other loads, 21 by node) in
                                panels of dense.h */
    double *least_precision; /* (n_gauges) P_ii at the upper end, where it is smallest */
    double *margin;          /* (n_gauges) the largest sqrt(P_ii), over |V_i| */
    double *bound;           /* (n_gauges) upper bounds of |V_i|^2 / P_ii, 0 where no other gauge checks one; */
    int bounded;             /* 0 if that is open for some */
} Interval;

/* Errors in proportion to strain: current_errors.h. */
typedef struct {
    size_t n_other;         /* other loads */
    Interval interval[CACHED_INTERVALS];
    size_t next;              /* the one to give way */
    double *of_gauge;         /* (21, n) of the map, in panels */
    double *common;           /* (n_terms, 6, whole) V E */
    double *rows;             /* (6 n_terms, n) E, in panels */
    /* Of the step. */
    double *powers;           /* (6, 21) c_a c_b less its mean, times powers of the ratio in its interval */
    double *value;            /* (16) G D G' and the trace of P D, with all gauges */
    double *own;              /* (n) D_ii of the gauges' own errors */
    double *load_along;       /* (5 and other loads, 6 n_terms) E G' where gauges are lost, of G below, */
    double *lost_along;       /* (n_lost, 6 n_terms) and E Y */
    double *sized;            /* (6 n_terms) scratch of a product with D */
    /* Of an interval, or of the lost gauges of the step. */
    double *weighted, *gain;  /* (5 and other loads, whole) by direction; G */
    double *unresolved, *precision, *product; /* (whole) u, P_ii, and products of them */
    double *common_load;      /* (6, 5 and other loads) */
    double *node;             /* (16 and other loads, 21) at a point */
    double *polynomial;       /* (16 and other loads, 126) */
    double *sum;              /* (24) */
} CurrentErrors;

/* What lost gauges hold of the directions at u = 1 / D. */
typedef struct {
    double *root;   /* (dense_rows(n_gauges)) D^-1/2 */
    double *matrix; /* (n_gauges, n_lost + 1) by columns: D^-1/2 of V_R and of V (m - d_0), after QR */
    double *head;   /* (2 n_gauges) of householder_columns */
} LostRows;

/* Numbers of the last step. w etc. hold one entry per direction. Those down to `interval` follow from the gauges in use and
   the ratio, and are kept while both are the same. */
typedef struct {
    const MaskedMap *masked;           /* for the gauges in use; NULL where nothing is kept, */
    unsigned long number;              /* and its number */
    double ratio;                      /* s */
    double *unresolved;                /* u */
    double *weight;                    /* of the loads that w stands for */
    double *spread;                    /* of the squares of the loads of a direction, in their covariance */
    const double *of_mean;             /* (n_gauges) V (m - d_0), lost gauges' predicted from the others */
    size_t n_lost;
    size_t *lost;                      /* (n_lost) */
    LostRows qr_of_truth, qr_of_gain;  /* the same arrays where the gain is the prior's */
    double *y;                         /* (n_lost, dense_rows(n_gauges)) Y, P = P_all - Y Y' */
    double *growth;                    /* (5, n_lost) B, then X: what the lost gauges add to the covariance is X X' */
    double per_pressure[N_LOADS];      /* about the map's moment point, as all loads */
    double base[N_LOADS * N_LOADS];    /* covariance without errors at the current strain */
    double *bound;                     /* (narrow_rows(n_gauges)) as Interval has them, with lost gauges */
    int bounded;
    const Interval *interval;          /* that the ratio is in */
    double pressure;                   /* q_inf [Pa] */
    double *w;                         /* V r, lost gauges' predicted from the others */
    double *x;                         /* u w */
    double *scratch[2];                /* (dense_rows(n_gauges)) */
    float *narrow, *narrow_z;          /* (narrow_rows(n_gauges)) */
    double *z;                         /* (n_gauges) left as it is where the screen in float decides */
    double chi_square;                 /* [1] */
    double limit_ratio;                /* of the limits of chi-square and z^2 over those at the mean strain [1] */
    double loads[N_LOADS], covariance[N_LOADS * N_LOADS];
} ScaledStep;

typedef struct {
    const Map *map;
    const OtherLoads *other_loads; /* of a map with loads in addition to the five; NULL for others */
    int wide;          /* wide_of_processor() */
    double *rows;      /* V in panels: w = V r */
    double *columns;   /* V' in panels */
    double *square;    /* the squares of V' in panels: P_ii = sum of u V_ai^2 */
    double *squares;   /* (16, n) products of the loads of each direction, in panels */
    double *loads;     /* (8, n) loads of each direction, in panels */
    float *screen;     /* V' with columns of length 1, in panels of float */
    double *size;      /* (n) |V_i| */
    double *of_gain;   /* (n) u of the gain, in which the prior of the states is another than in truth; NULL where it is u */
    double *shift;     /* (5, n) scratch of lost_rows.c */
    double *of_lost;   /* (n_lost, dense_rows(n)) the same: D^-1/2 Q_head */
    double *mean;      /* (dense_rows(n)) V (m - d_0) of all gauges, */
    double *mean_left; /* the same where some are lost */
    double *own_mean;  /* (dense_rows(n)) scratch: m - d_0, 0 for lost gauges */
    double *residual;  /* (dense_rows(n)) */
    CurrentErrors errors;
    ScaledStep step;
} Scaled;

/* Hand out the arrays for n gauges. */
void lost_rows_arrays(size_t n, LostRows *rows, Room *room);

/* Of step->lost at step->unresolved, and at the u of the gain: step->qr_of_truth, step->qr_of_gain, Y and growth; of_mean is
   predicted. */
void lost_rows_prepare(Scaled *scaled);

/* Loads of direction a by load k: the five, then other ones. */
static inline double load_of(const Scaled *scaled, size_t a, size_t k) {
    const NoiseMatrices *made = scaled->map->made;
    return k < N_LOADS ? made->load[N_LOADS * a + k] : made->other_load[a * scaled->errors.n_other + k - N_LOADS];
}

/* Row k of B, of loads in addition to the five in scratch of these; and B_k Y' taken off a gain (n_gauges). */
const double *lost_rows_growth(const Scaled *scaled, size_t k);
void lost_rows_take(const Scaled *scaled, const double *growth, double *gain);

/* Then, of a sample: chi-square and x; w of the lost gauges is predicted. */
void lost_rows_condition(Scaled *scaled);

/* The products of set_products, summed over the directions, by the gain that the lost gauges leave. */
void lost_rows_products(Scaled *scaled, double products[N_VALUES]);

/* Add the products of pairs of five loads and of five others (row by row, 15). */
void add_products(const double *first, const double *second, double products[N_VALUES]);

#endif
