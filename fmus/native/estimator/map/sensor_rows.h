/* Sensors that are no strain gauges: the rows of a map behind the gauges' rows, whose readings have units and ranges
   of their own.

   The C counterpart of strainfmu/estimator/map/sensors.py; it is part "sensors" of
   resources/map.bin. */

#ifndef SENSOR_ROWS_H
#define SENSOR_ROWS_H

#include "container.h"

/* Arrays are of the rows behind the strain gauges, and point into the bytes of the file. */
typedef struct {
    size_t n_strains;      /* strain gauges: all rows of a map without the part */
    int has_thrust;        /* whether thrust moves a reading */
    MAP_MEMBERS(SENSORS)
} SensorRows;

/* Read the part of a map of n_gauges rows, if there is one. 1; 0 after a message. */
int sensor_rows_parse(MapFile *file, size_t n_gauges, SensorRows *rows);

/* What a sensor reads [unit], less what thrust [N] makes of it. */
static inline double without_thrust(const SensorRows *rows, size_t which, double reading, double thrust) {
    const double response = rows->thrust_response[which];
    return response == 0.0 ? reading : reading - thrust * response;
}

#endif
