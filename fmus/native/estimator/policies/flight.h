/* The nonlinear estimator: all of a sample, from the track of the last step. */

#ifndef FLIGHT_H
#define FLIGHT_H

#include "flight_outputs.h"

/* Read the parts of the tables, if there are any, and allocate. 1; 0 after a message. inputs, output, linear and loads are
   set. */
int flight_create(Flight *flight, MapFile *file);
void flight_reset(Flight *flight);

/* Set all outputs for the present inputs, from the track of the last step. */
void flight_update(Flight *flight);

/* Set flight->loads->value for the last update: by the tables, or by the linear map where it stands in or is alone. */
void flight_other_loads_update(Flight *flight);

/* The most Gauss-Newton iterations of a step; the last step's are flight->solver.iterations. */
size_t flight_most_iterations(const Flight *flight);

/* The gauges have other errors: the linear estimator's. */
void flight_renew(Flight *flight);

/* What the last step left is what the next one starts from. */
void flight_take_next(Flight *flight);

/* Whether a serialised track may be read. */
int flight_track_fits(const Flight *flight, const Track *track);

#endif
