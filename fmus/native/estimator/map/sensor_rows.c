/* Part "sensors" of map.bin: auxiliary sensors are the last rows of a map. Row = (reading - thrust_response thrust)
   / scale, so that a row is a strain to all equations; a |reading| above the largest is not used.
   docs/developers/native.md, "Gauges, zero offsets, temperatures"; strainfmu/estimator/map/sensors.py. */

#include "sensor_rows.h"

int sensor_rows_parse(MapFile *file, size_t n_gauges, SensorRows *rows) {
    if (map_has(file, "sensors")) {
        MAP_READ(file, "sensors", SENSORS, SensorRows, rows);
    }
    for (size_t k = 0; file->good && k < rows->count; k++) {
        rows->has_thrust |= rows->thrust_response[k] != 0.0;
    }
    rows->n_strains = file->length[SYM_STRAINS] = n_gauges - rows->count;
    return file->good;
}
