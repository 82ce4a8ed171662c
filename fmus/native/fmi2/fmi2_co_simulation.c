/* FMI 2.0.5: co-simulation. */

#include "fmi2.h"

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real currentCommunicationPoint, fmi2Real communicationStepSize,
                      fmi2Boolean noSetFMUStatePriorToCurrentPoint) {
    (void)noSetFMUStatePriorToCurrentPoint;
    return (fmi2Status)instance_step(c, "fmi2DoStep", currentCommunicationPoint, communicationStepSize);
}

fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                                       const fmi2Integer order[], const fmi2Real value[]) {
    (void)vr;
    (void)order;
    (void)value;
    return nvr == 0 && c != NULL ? fmi2OK : (fmi2Status)instance_not_offered(c, "fmi2SetRealInputDerivatives");
}

fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                                        const fmi2Integer order[], fmi2Real value[]) {
    (void)vr;
    (void)order;
    (void)value;
    return nvr == 0 && c != NULL ? fmi2OK : (fmi2Status)instance_not_offered(c, "fmi2GetRealOutputDerivatives");
}

fmi2Status fmi2CancelStep(fmi2Component c) {
    return (fmi2Status)instance_not_offered(c, "fmi2CancelStep");
}

/* No step is ever pending, so the status of steps is known only by fmi2DoStep itself. */
#define UNKNOWN(function, Type)                                                       \
    fmi2Status function(fmi2Component c, const fmi2StatusKind s, fmi2##Type *value) { \
        (void)s;                                                                      \
        (void)value;                                                                  \
        return c == NULL ? fmi2Error : fmi2Discard;                                   \
    }
UNKNOWN(fmi2GetStatus, Status)
UNKNOWN(fmi2GetIntegerStatus, Integer)
UNKNOWN(fmi2GetStringStatus, String)

/* Section 4.2.2: what an importer reads after fmi2Discard. */
fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind s, fmi2Real *value) {
    const Instance *instance = c;
    if (instance == NULL || value == NULL) {
        return fmi2Error;
    }
    if (s != fmi2LastSuccessfulTime) {
        return fmi2Discard;
    }
    *value = instance->ending ? instance->last_successful_time : instance->model->time;
    return fmi2OK;
}

fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind s, fmi2Boolean *value) {
    const Instance *instance = c;
    if (instance == NULL || value == NULL) {
        return fmi2Error;
    }
    if (s != fmi2Terminated) {
        return fmi2Discard;
    }
    *value = instance->ending ? fmi2True : fmi2False;
    return fmi2OK;
}
