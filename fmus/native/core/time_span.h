/* Times that an importer gives [s]. */

#ifndef TIME_SPAN_H
#define TIME_SPAN_H

/* Whether an experiment may start at a time, and end at `stop` if it has a stop. */
int is_time_span(double start, int has_stop, double stop);

/* Whether a step may be of a size; then *end is its end. */
int step_ends(double start, double size, double *end);

/* Whether a step ends behind the stop time, by more than sums of step sizes round. */
int is_beyond_stop(double end, double size, double stop);

#endif
