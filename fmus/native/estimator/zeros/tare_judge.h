/* The zeros that a window of readings gives, and what speaks against them: strainfmu/estimator/zeros/tare.py. */

#ifndef TARE_JUDGE_H
#define TARE_JUDGE_H

#include "tare_state.h"

/* Number of doubles of its scratch. */
size_t judge_doubles(size_t n_gauges);

/* Set tare->zero from tare->found. 1; 0, and they are as before, after a reason in text. */
int tare_judge(Tare *tare, const double *mean_strain, char text[MODEL_TEXT_SIZE]);

#endif
