/* What an estimator of a map in form "dynamic_pressure" holds: tables made once, levels of the pressure ratio, and the
   numbers of the last step.

   Directions are those of docs/explanation/dynamic_pressure.md, there are as many as gauges. */

#ifndef SCALED_STATE_H
#define SCALED_STATE_H

#include "../map/map_resource.h"

#define N_VALUES 16 /* of a level per pair: the 15 entries of a covariance row by row, and the expected chi-square */

/* Levels that are kept for each set of gauges: a factor 180 of dynamic pressure. */
#define CACHED_LEVELS 16

/* Products at one pressure ratio for one set of gauges. They depend on nothing else, so that keeping them changes no
   result. */
typedef struct {
    double ratio;     /* NaN before it is known */
    double *products; /* (16, 21) G H_ab G' and trace of P H_ab, in panels of dense.h; strainfmu/estimator/map/
                         proportional_errors.py */
    double *inverse;  /* (n_gauges) 1 / P_ii times |V_i|^2 by gauge in use, */
    double *slope;    /* its derivative by the square of the ratio, */
    double *checked;  /* 0 where no other gauge checks this one at this ratio or a larger one, else 1, */
    int has_further;  /* whether further_loads.h has its products, */
    double *margin;   /* and the largest sqrt(P_ii) of all gauges at this ratio or a larger one, over |V_i| */
} Level;

typedef struct {
    Level level[CACHED_LEVELS];
    size_t next; /* the one to give way */
} Levels;

/* Numbers of the last step. w etc. hold one entry per direction. */
typedef struct {
    double ratio;                      /* s */
    double *unresolved;                /* u */
    double *weight;                    /* of the loads that w stands for */
    double *spread;                    /* of the squares of the loads of a direction, in their covariance */
    double *w, *of_mean;               /* V r and V (m - d_0), those of lost gauges predicted from the others */
    double *x;                         /* u w */
    double *scratch[2];                /* (dense_rows(n_gauges)) */
    double *bound;                     /* (narrow_rows(n_gauges)) upper bounds of 1 / P_ii, as Level has them */
    float *narrow, *narrow_z;          /* (narrow_rows(n_gauges)) */
    size_t n_lost;
    size_t *lost;                      /* (n_lost) */
    double *matrix;                    /* (n_gauges, n_lost + 2) by columns: D V_R, D w, D V (m - d_0) after QR */
    double *head;                      /* (2 n_gauges) of householder_columns */
    double *growth;                    /* (5, n_lost) B, then X: what the lost gauges add to the covariance is X X' */
    double chi_square, expected_ratio; /* [1] */
    double loads[N_LOADS], per_pressure[N_LOADS], covariance[N_LOADS * N_LOADS]; /* about the map's moment point */
    double product[N_PAIRS + 3];       /* c_a c_b less its mean, and zeros for dense.h */
    double low[N_VALUES], high[N_VALUES], part; /* of the levels, and where the ratio is between them */
    const Level *levels[2];
} ScaledStep;

typedef struct {
    double *rows;      /* V in panels: w = V r */
    double *columns;   /* V' in panels */
    double *square;    /* the squares of V' in panels: P_ii = sum of u V_ai^2 */
    double *squares;   /* (16, n) products of the loads of each direction, in panels */
    double *loads;     /* (8, n) loads of each direction, in panels */
    float *screen;     /* V' with columns of length 1, in panels of float */
    double *size;      /* (n) |V_i| */
    double *mean;      /* (dense_rows(n)) V (m - d_0) of all gauges */
    double *own_mean;  /* (dense_rows(n)) scratch: m - d_0, 0 for lost gauges */
    double *residual;  /* (dense_rows(n)) */
    double *work[2];   /* (n, n) and (16 n) of a level */
    ScaledStep step;
} Scaled;

#endif
