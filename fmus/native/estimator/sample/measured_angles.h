/* Angle of attack and sideslip that are measured, as components of the flow direction. */

#ifndef MEASURED_ANGLES_H
#define MEASURED_ANGLES_H

#include "inputs.h"

/* u and w [rad], with precisions, 0 where not known. */
typedef struct {
    size_t count; /* of the angles that are known */
    double value[2], precision[2];
} MeasuredAngles;

/* Those of the inputs. An angle that is not known is 0 for the other one. */
void measured_angles(const Inputs *inputs, MeasuredAngles *angles);

#endif
