/* FMI 3.0: co-simulation. */

#include "fmi3.h"

fmi3Status fmi3EnterStepMode(fmi3Instance instance) {
    const Instance *s = instance;
    const int allowed = s != NULL && s->kind == CO_SIMULATION_3;
    return (fmi3Status)instance_enter(instance, "fmi3EnterStepMode", allowed ? EVENT : 0, STEP);
}

fmi3Status fmi3DoStep(fmi3Instance instance, fmi3Float64 currentCommunicationPoint,
                      fmi3Float64 communicationStepSize, fmi3Boolean noSetFMUStatePriorToCurrentPoint,
                      fmi3Boolean *eventHandlingNeeded, fmi3Boolean *terminateSimulation, fmi3Boolean *earlyReturn,
                      fmi3Float64 *lastSuccessfulTime) {
    static const char NAME[] = "fmi3DoStep";
    Instance *s = instance;
    (void)noSetFMUStatePriorToCurrentPoint;
    if (!instance_allows(s, NAME, STEP) || !instance_given(s, NAME, eventHandlingNeeded)
        || !instance_given(s, NAME, terminateSimulation) || !instance_given(s, NAME, earlyReturn)
        || !instance_given(s, NAME, lastSuccessfulTime)) {
        return fmi3Error;
    }
    const int status = instance_step(s, NAME, currentCommunicationPoint, communicationStepSize);
    if (status != STATUS_ERROR) {
        *eventHandlingNeeded = fmi3_is_due(s) ? fmi3True : fmi3False;
        *earlyReturn = fmi3False;
        *terminateSimulation = s->ending ? fmi3True : fmi3False;
        *lastSuccessfulTime = s->ending ? s->last_successful_time : s->model->time;
    }
    return (fmi3Status)status;
}
