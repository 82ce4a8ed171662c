/* What a law is after a sample, by the gain of either filter: strainfmu/estimator/reference/kalman.py. */

#ifndef LAW_UPDATE_H
#define LAW_UPDATE_H

#include "law.h"

#define LEAST_LEFT 1e-2 /* part of a variance that is left, above which a difference has digits enough */

/* Joseph's form of the covariance: A P A' + X + X', X = (K R / 2 - A C G') K', A = I - K H. */
typedef struct {
    size_t rows;              /* of a sample */
    size_t n_read;            /* states that it reads, the first ones */
    const double *gain;       /* (n, rows) K */
    const double *read;       /* (n, order) K H; what is behind the states that are read does not count */
    const double *white;      /* (rows, rows) R, of what is white and of the considered errors */
    const double *considered; /* (n, rows) C G' */
    double *half;             /* (n, rows) scratch, as the next ones */
    double *turned;           /* (rows or order, order) */
    double *square;           /* (3, order, order) */
} Joseph;

void law_set_joseph(const Laws *laws, const Joseph *joseph, const Law *law, Law *after);

/* The covariance with the errors of zeros after a sample; arguments as in Joseph. */
void law_update_zeros(const Laws *laws, const Joseph *joseph, const Law *law, Law *after);

/* out (columns, rows) = matrix' (rows, columns), rows of each so far apart. */
void transpose(size_t rows, size_t columns, const double *matrix, size_t row, double *out, size_t out_row);

#endif
