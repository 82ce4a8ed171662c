/* FMI 2.0.5: model exchange, without continuous states and event indicators. */

#include "fmi2.h"

#include <string.h>

fmi2Status fmi2EnterEventMode(fmi2Component c) {
    return (fmi2Status)instance_enter(c, "fmi2EnterEventMode", EVENT | CONTINUOUS_TIME, EVENT);
}

fmi2Status fmi2NewDiscreteStates(fmi2Component c, fmi2EventInfo *eventInfo) {
    static const char NAME[] = "fmi2NewDiscreteStates";
    if (!instance_allows(c, NAME, EVENT) || !instance_given(c, NAME, eventInfo)) {
        return fmi2Error;
    }
    instance_follow_event(c);
    memset(eventInfo, 0, sizeof *eventInfo);
    return fmi2OK;
}

fmi2Status fmi2EnterContinuousTimeMode(fmi2Component c) {
    return (fmi2Status)instance_go_on(c, "fmi2EnterContinuousTimeMode", EVENT);
}

fmi2Status fmi2CompletedIntegratorStep(fmi2Component c, fmi2Boolean noSetFMUStatePriorToCurrentPoint,
                                       fmi2Boolean *enterEventMode, fmi2Boolean *terminateSimulation) {
    static const char NAME[] = "fmi2CompletedIntegratorStep";
    (void)noSetFMUStatePriorToCurrentPoint;
    if (!instance_allows(c, NAME, CONTINUOUS_TIME) || !instance_given(c, NAME, enterEventMode)
        || !instance_given(c, NAME, terminateSimulation)) {
        return fmi2Error;
    }
    int event = 0;
    const fmi2Status status = (fmi2Status)instance_end_solver_step(c, NAME, &event);
    *enterEventMode = event ? fmi2True : fmi2False;
    *terminateSimulation = fmi2False;
    return status;
}

fmi2Status fmi2SetTime(fmi2Component c, fmi2Real time) {
    return (fmi2Status)instance_set_time(c, "fmi2SetTime", EVENT | CONTINUOUS_TIME, time);
}

#define EMPTY_LIST(function, modes, Type)                               \
    fmi2Status function(fmi2Component c, Type values[], size_t n) {     \
        (void)values;                                                   \
        return (fmi2Status)instance_empty_list(c, #function, modes, n); \
    }
EMPTY_LIST(fmi2SetContinuousStates, CONTINUOUS_TIME, const fmi2Real)
EMPTY_LIST(fmi2GetDerivatives, FMI2_READABLE, fmi2Real)
EMPTY_LIST(fmi2GetEventIndicators, FMI2_READABLE, fmi2Real)
EMPTY_LIST(fmi2GetContinuousStates, FMI2_READABLE, fmi2Real)
EMPTY_LIST(fmi2GetNominalsOfContinuousStates, FMI2_READABLE, fmi2Real)
