/* Gauges that are lost: the others predict them, so that the directions of all gauges stay. */

#ifndef LOST_ROWS_H
#define LOST_ROWS_H

#include "scaled_state.h"

/* Hand out the arrays for n gauges. */
void lost_rows_arrays(size_t n, LostRows *rows, Room *room);

/* Of step->lost at step->unresolved, and at the u of the gain: step->qr_of_truth, step->qr_of_gain, Y and growth; of_mean is
   predicted. */
void lost_rows_prepare(Scaled *scaled);

/* The row of B of load j in addition to the five, in scratch of the other loads. */
const double *lost_rows_other_growth(const Scaled *scaled, size_t j);

/* Then, of a sample: chi-square and x; w of the lost gauges is predicted. */
void lost_rows_condition(Scaled *scaled);

/* The products of set_products, summed over the directions, by the gain that the lost gauges leave. */
void lost_rows_products(Scaled *scaled, double products[N_VALUES]);

/* Add the products of pairs of five loads and of five others (row by row, 15). */
void add_products(const double *first, const double *second, double products[N_VALUES]);

#endif
