/* Loads by direction of a map in form "absolute": the gain of its regularisation, and what that leaves. */

#ifndef FIXED_LOADS_H
#define FIXED_LOADS_H

#include "noise_state.h"

/* Number of doubles of noise->rows that it needs. */
size_t fixed_loads_doubles(const Map *map);

/* Of the directions and their loads by states, as pressure_directions.h makes them: made->load becomes the gain,
   made->noise_left and made->prior_left what the noise and the prior leave, and made->unseen takes up what no strain shows
   of the loads that go with the noise. */
void fixed_loads(AddedNoise *noise);

#endif
