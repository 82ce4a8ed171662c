/* Air data of a sample: what a dynamic pressure is computed from, and its standard deviation then; measured angles as
   components of the flow direction. strainfmu/estimator/reference/air.py in C. */

#ifndef AIR_DATA_H
#define AIR_DATA_H

#include "inputs.h"

/* Relative standard deviations of what a dynamic pressure is computed from, which no other measurement confirms: of M by the
   day's temperature and wind, of p_inf by its port, of p(h) by the day; as in that file. */
#define DAY_OF_MACH 0.025
#define DAY_OF_PRESSURE 0.03
#define DAY_OF_ALTITUDE 0.07

/* The values of the input q_source; it is AUTO where it is none of them. */
typedef enum { AUTO, INDEPENDENT, MACH_AND_PRESSURE, MACH_AND_ALTITUDE } PressureSource;

/* p(h) of the standard atmosphere [Pa]; NaN where the altitude is not known, 0, which no flight has, where it is above the
   atmosphere. */
double pressure_by_altitude(const Inputs *inputs);

/* The source of the dynamic pressure of the inputs, never AUTO: what nothing states counts as computed from the Mach number,
   where that is known, and from the static pressure, or else from an atmosphere. */
PressureSource pressure_source(const Inputs *inputs);

/* The relative standard deviation of a dynamic pressure by the ones of what it is computed from. */
double computed_pressure_error(double mach, double mach_std, double pressure_std);

/* The standard deviation [Pa] of a dynamic pressure that is computed: the stated one, which has to be larger than `own`,
   of its sources, where the inputs do not state the source. NaN for none stated. */
double computed_pressure_std(const Inputs *inputs, double stated, double own);

/* u and w [rad], with precisions, 0 where not known. */
typedef struct {
    size_t count; /* of the angles that are known */
    double value[2], precision[2];
} MeasuredAngles;

/* Those of the inputs. An angle that is not known is 0 for the other one. */
void measured_angles(const Inputs *inputs, MeasuredAngles *angles);

#endif
