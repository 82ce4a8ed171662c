#include "flow_parameters.h"

#include <math.h>
#include <stdio.h>

#define N_PARAMETER_SIZES 8
#define MAX_PARAMETERS 64

int flow_parameters_parse(const Section *section, FlowParameters *parameters, char text[MODEL_TEXT_SIZE]) {
    const size_t values_at = 4 * N_PARAMETER_SIZES;
    if (section->content == NULL) {
        return 1;
    }
    const size_t count = section->length >= values_at ? u32_at(section->content, 0) : 0, n_values = 2 + 3 * count;
    if (count < 1 || count > MAX_PARAMETERS
        || section->length != values_at + n_values * sizeof(double) + count * PARAMETER_NAME_SIZE) {
        snprintf(text, MODEL_TEXT_SIZE, "holds parameters of the flow whose number cannot be");
        return 0;
    }
    const double *values = (const double *)(const void *)(section->content + values_at), *next = values;
    parameters->tolerance = *take_doubles(&next, 1);
    parameters->largest_score = *take_doubles(&next, 1);
    parameters->minimum = take_doubles(&next, count);
    parameters->maximum = take_doubles(&next, count);
    parameters->span = take_doubles(&next, count);
    parameters->names = (const char *)next;
    int good = 1;
    for (size_t i = 0; i < n_values; i++) {
        good = good && isfinite(values[i]);
    }
    for (size_t i = 0; i < count; i++) {
        good = good && parameters->span[i] > 0.0 && parameters->maximum[i] >= parameters->minimum[i]
            && memchr(parameters->names + i * PARAMETER_NAME_SIZE, '\0', PARAMETER_NAME_SIZE) != NULL;
    }
    if (!good) {
        snprintf(text, MODEL_TEXT_SIZE, "holds parameters of the flow with a value that cannot be");
        return 0;
    }
    parameters->count = count;
    return 1;
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
