/* Part "parameters" of map.bin: ranges of flow parameters. The score of a value is its distance from the range over
   the span, 0 inside, for NaN and for a value that is not known; a score above the tolerance puts health to OUTSIDE.
   The linear estimate itself does not use the values. docs/howto/settings_and_health.md;
   strainfmu/estimator/map/flow_parameters.py. */

#include "flow_parameters.h"

int flow_parameters_parse(MapFile *file, FlowParameters *parameters) {
    if (!map_has(file, "parameters")) {
        return file->good;
    }
    MAP_READ(file, "parameters", PARAMETERS, FlowParameters, parameters);
    for (size_t i = 0; file->good && i < parameters->count; i++) {
        map_require(file, parameters->maximum[i] >= parameters->minimum[i], "parameters.maximum",
                    "no number below the minimum");
    }
    return file->good;
}

double parameter_score(const FlowParameters *parameters, size_t which, double value) {
    const double low = parameters->minimum[which], high = parameters->maximum[which];
    const double excess = value < low ? low - value : value > high ? value - high : 0.0;
    const double score = excess / parameters->span[which];
    return score < parameters->largest_score ? score : parameters->largest_score;
}

size_t parameter_outside(const FlowParameters *parameters, const double *value, double not_known) {
    for (size_t i = 0; i < parameters->count; i++) {
        if (value[i] != not_known && parameter_score(parameters, i, value[i]) > parameters->tolerance) {
            return i;
        }
    }
    return SIZE_MAX;
}
