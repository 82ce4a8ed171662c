/* Errors of the zeros of strain gauges in a filter: constant in time, considered, never estimated.

   Each gauge has one of its own and all have one in common. A law holds the covariance of its states with them, per unit
   deviation: a column for each gauge, in lanes, then that in common. Other zeros or deviations have other errors: a filter
   begins again where they change. */

#ifndef ZERO_ERRORS_H
#define ZERO_ERRORS_H

#include <stddef.h>

typedef struct {
    size_t n_strains; /* strain gauges, the first rows of a sample */
    size_t gauges;    /* all rows of gauges, in lanes */
    size_t columns;   /* of a law; a multiple of LANES */
    int in_use;       /* whether any zero has a deviation */
    int may_move;     /* whether zeros that move are the same ones: while derivatives are taken */
    double *now;      /* (2 n_strains + 1) zeros and deviations in use; all 0 where none has a deviation */
    double *own, *common; /* (gauges) deviations, 0 of gauges that a sample does not read */
} ZeroErrors;

/* Fill in the sizes; number of doubles that the arrays take, and handing them out. */
void zero_errors_lay_out(size_t n_strains, size_t n_gauges, ZeroErrors *errors);
size_t zero_errors_doubles(const ZeroErrors *errors);
void zero_errors_arrays(ZeroErrors *errors, double **doubles);

/* Number of doubles that a law notes of them. */
size_t zero_errors_noted(const ZeroErrors *errors);

/* Zeros and deviations (2 n_strains + 1) in use; whether they are those that a law has noted; noting them. */
void zero_errors_take(ZeroErrors *errors, const double *zeros);
int zero_errors_same(const ZeroErrors *errors, const double *noted);
void zero_errors_note(const ZeroErrors *errors, double *noted);

/* Whether what a law has noted has a deviation. */
int zero_errors_noted_any(const ZeroErrors *errors, const double *noted);

/* For the rest: they are in use. The gauges that a sample reads. */
void zero_errors_read(ZeroErrors *errors, const unsigned char *used);

/* Add their covariance to the upper triangle of that of rows, `row` apart. */
void zero_errors_add(const ZeroErrors *errors, double *covariance, size_t row);

/* Add C G' to sums (n, rows), of a law's C (n, columns); rows of sums lie `row` apart. */
void zero_errors_considered(const ZeroErrors *errors, size_t n, const double *cross, double *sums, size_t row);

/* Take K G off C (n, columns), of gains K (n, rows), `row` apart. */
void zero_errors_subtract(const ZeroErrors *errors, size_t n, const double *gain, size_t row, double *cross);

#endif
