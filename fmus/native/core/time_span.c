/* Times that an importer gives: whether they can be, and whether a step ends behind the stop time. Sums of step
   sizes round, by less than a hundredth of a step in a million steps: an end that is behind the stop time by no more
   counts as the stop time. */

#include "time_span.h"

#include <math.h>

/* Largest error of the end of the last step, as a fraction of its size: a million steps that are added up err by less. */
#define ROUNDING 1e-2

int is_time_span(double start, int has_stop, double stop) {
    return isfinite(start) && (!has_stop || stop >= start);
}

int step_ends(double start, double size, double *end) {
    *end = start + size;
    return size > 0.0 && isfinite(*end);
}

int is_beyond_stop(double end, double size, double stop) {
    return end - stop > ROUNDING * size;
}
