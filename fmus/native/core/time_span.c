#include "time_span.h"

#include <math.h>

int is_time_span(double start, int has_stop, double stop) {
    return isfinite(start) && (!has_stop || stop >= start);
}

int step_ends(double start, double size, double *end) {
    *end = start + size;
    return size > 0.0 && isfinite(*end);
}
