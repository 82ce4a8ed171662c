/* What the linear estimator holds: the map's matrices for the gauges in use, and the numbers of the last step. */

#ifndef LINEAR_STATE_H
#define LINEAR_STATE_H

#include "../sample/outputs.h"
#include "../update/prepared.h"
#include "../update/scaled_state.h"
#include "envelope.h"

typedef struct {
    const Map *map;
    const Inputs *inputs;
    double *output;        /* (N_OUTPUTS) of the estimator */
    OtherLoads *other_loads;      /* loads in addition to the five, of a map that has some */
    int wide;              /* wide_of_processor() */
    Flow flow;             /* of the inputs since output was computed */
    int conditions;        /* of the sample, bits of outputs.h */
    Prepared prepared;
    HalfSpaces half_spaces;
    Scaled scaled;
} Linear;

#endif
