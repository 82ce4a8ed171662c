#include "sensor_rows.h"

#include <math.h>
#include <stdio.h>

#define N_SENSOR_SIZES 8
#define N_ARRAYS 3

int sensor_rows_parse(const Section *section, size_t n_gauges, SensorRows *rows, char text[MODEL_TEXT_SIZE]) {
    const size_t values_at = 4 * N_SENSOR_SIZES;
    rows->n_strains = n_gauges;
    if (section->content == NULL) {
        return 1;
    }
    const size_t n_strains = section->length >= values_at ? u32_at(section->content, 0) : 0;
    const size_t count = n_gauges - n_strains;
    if (n_strains < 1 || n_strains > n_gauges
        || section->length != values_at + N_ARRAYS * count * sizeof(double)) {
        snprintf(text, MODEL_TEXT_SIZE, "holds sensors whose number cannot be");
        return 0;
    }
    const double *next = (const double *)(const void *)(section->content + values_at);
    rows->scale = take_doubles(&next, count);
    rows->largest = take_doubles(&next, count);
    rows->thrust_response = take_doubles(&next, count);
    int good = 1;
    for (size_t k = 0; k < count; k++) {
        good = good && rows->scale[k] > 0.0 && isfinite(rows->scale[k]) && rows->largest[k] > 0.0
            && isfinite(rows->largest[k]) && isfinite(rows->thrust_response[k]);
        rows->has_thrust |= rows->thrust_response[k] != 0.0;
    }
    if (!good) {
        snprintf(text, MODEL_TEXT_SIZE, "holds sensors with a value that cannot be");
        return 0;
    }
    rows->n_strains = n_strains;
    rows->count = count;
    return 1;
}
