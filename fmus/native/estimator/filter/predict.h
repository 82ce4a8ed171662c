/* The process of a filter's states between samples: docs/explanation/filter.md. */

#ifndef PREDICT_H
#define PREDICT_H

#include "law.h"

/* The time [s] that a filter goes on by between two samples, at most the longest. */
double elapsed_time(double from, double to, double longest);

/* Covariance of the modes' amplitudes, in laws->stationary, by the temperature sensors that read. */
void laws_set_modes(Laws *laws);

/* laws->predicted from laws->law, over a time step with a time constant [s], but for its cross covariance: it is the largest
   part, and moved where it is used. Variances that may be widened are so many times those of the stationary law.
   Amplitudes of modes stay where other sensors read than in the last sample. */
void laws_predict(Laws *laws, double time_step, double time_constant, double widening);
void laws_move_cross(Laws *laws);

/* to = scale F from, of `count` columns, for the last such step. */
void laws_move_rows(const Laws *laws, size_t count, double scale, const double *from, double *to);

#endif
