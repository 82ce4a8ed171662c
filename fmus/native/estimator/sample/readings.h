/* The readings of a sample: which of them are used, and the strains that they stand for. */

#ifndef READINGS_H
#define READINGS_H

#include "inputs.h"

/* Whether a gauge may be used: the caller trusts it, and its reading was set and is a number within its range, which is
   `range` [m/m] for strain. */
unsigned char gauge_in_use(const Inputs *inputs, size_t gauge, double range);

/* Whether strain is no reading: every gauge that may be used reads exactly 0 in a flow, as no gauge under load does. Then
   none is used. With the linear estimator a flow is a dynamic pressure of one, with tables any sample. */
int readings_silent(const Inputs *inputs);

/* Whether the gauges that may be used are the gauges of a mask (n_gauges). */
int readings_are_of(const Inputs *inputs, const unsigned char *mask);

/* Readings `first` up to, not including, `end` were set. */
void readings_note_given(Inputs *inputs, size_t first, size_t end);

/* Take the zeros in use off the strains of the inputs, and scale other sensors. */
void readings_set_strain(Inputs *inputs);

#endif
