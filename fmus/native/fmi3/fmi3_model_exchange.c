/* FMI 3.0: model exchange, without continuous states and event indicators. */

#include "fmi3.h"

fmi3Status fmi3EnterContinuousTimeMode(fmi3Instance instance) {
    const Instance *s = instance;
    const int allowed = s != NULL && s->kind == MODEL_EXCHANGE_3;
    return (fmi3Status)instance_go_on(instance, "fmi3EnterContinuousTimeMode", allowed ? EVENT : 0);
}

fmi3Status fmi3CompletedIntegratorStep(fmi3Instance instance, fmi3Boolean noSetFMUStatePriorToCurrentPoint,
                                       fmi3Boolean *enterEventMode, fmi3Boolean *terminateSimulation) {
    static const char NAME[] = "fmi3CompletedIntegratorStep";
    (void)noSetFMUStatePriorToCurrentPoint;
    if (!instance_allows(instance, NAME, CONTINUOUS_TIME) || !instance_given(instance, NAME, enterEventMode)
        || !instance_given(instance, NAME, terminateSimulation)) {
        return fmi3Error;
    }
    int event = 0;
    const fmi3Status status = (fmi3Status)instance_end_solver_step(instance, NAME, &event);
    *enterEventMode = event ? fmi3True : fmi3False;
    *terminateSimulation = fmi3False;
    return status;
}

fmi3Status fmi3SetTime(fmi3Instance instance, fmi3Float64 time) {
    return (fmi3Status)instance_set_time(instance, "fmi3SetTime", EVENT | CONTINUOUS_TIME, time);
}

#define EMPTY_LIST(function, modes, Type)                                      \
    fmi3Status function(fmi3Instance instance, Type values[], size_t n) {      \
        (void)values;                                                          \
        return (fmi3Status)instance_empty_list(instance, #function, modes, n); \
    }
EMPTY_LIST(fmi3SetContinuousStates, CONTINUOUS_TIME, const fmi3Float64)
EMPTY_LIST(fmi3GetContinuousStateDerivatives, FMI3_READABLE, fmi3Float64)
EMPTY_LIST(fmi3GetEventIndicators, FMI3_READABLE, fmi3Float64)
EMPTY_LIST(fmi3GetContinuousStates, FMI3_READABLE, fmi3Float64)
EMPTY_LIST(fmi3GetNominalsOfContinuousStates, FMI3_READABLE, fmi3Float64)

static fmi3Status none(Instance *s, const char *function, size_t *number) {
    if (s == NULL || !instance_given(s, function, number)) {
        return fmi3Error;
    }
    *number = 0;
    return fmi3OK;
}

fmi3Status fmi3GetNumberOfEventIndicators(fmi3Instance instance, size_t *nEventIndicators) {
    return none(instance, "fmi3GetNumberOfEventIndicators", nEventIndicators);
}

fmi3Status fmi3GetNumberOfContinuousStates(fmi3Instance instance, size_t *nContinuousStates) {
    return none(instance, "fmi3GetNumberOfContinuousStates", nContinuousStates);
}
