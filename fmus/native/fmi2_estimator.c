/* The functions of FMI 2.0.5 for instances, modes, steps and states: co-simulation and model exchange, without
   continuous states or events of its own. */

#include <math.h>
#include <string.h>

#include "fmi2_common.h"
#include "instance_state.h"

static void write_message(const Instance *instance, int status, const char *category, const char *text) {
    fmi2CallbackLogger logger = (fmi2CallbackLogger)instance->logger;
    if (logger != NULL) {
        logger(instance->environment, instance->name, (fmi2Status)status, category, "%s", text);
    }
}

const char *fmi2GetTypesPlatform(void) {
    return fmi2TypesPlatform;
}

const char *fmi2GetVersion(void) {
    return fmi2Version;
}

fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean loggingOn, size_t nCategories,
                               const fmi2String categories[]) {
    Instance *s = c;
    if (s == NULL || (nCategories > 0 && !fmi2_given(s, "fmi2SetDebugLogging", categories))) {
        return fmi2Error;
    }
    s->events_logged = loggingOn && nCategories == 0;
    for (size_t i = 0; i < nCategories; i++) {
        const char *category = categories[i] != NULL ? categories[i] : "";
        if (strcmp(category, CATEGORY_EVENTS) == 0 || strcmp(category, "logAll") == 0) {
            s->events_logged = loggingOn != fmi2False;
        }
    }
    return fmi2OK;
}

fmi2Component fmi2Instantiate(fmi2String instanceName, fmi2Type fmuType, fmi2String fmuGUID,
                              fmi2String fmuResourceLocation, const fmi2CallbackFunctions *functions,
                              fmi2Boolean visible, fmi2Boolean loggingOn) {
    (void)visible;
    if (functions == NULL) {
        return NULL;
    }
    const Instance wanted = {
        .kind = fmuType == fmi2CoSimulation ? CO_SIMULATION_2 : MODEL_EXCHANGE_2,
        .name = instanceName != NULL ? instanceName : "",
        .write = write_message,
        .logger = (void (*)(void))functions->logger,
        .environment = functions->componentEnvironment,
        .events_logged = loggingOn != fmi2False,
    };
    if (instanceName == NULL || instanceName[0] == '\0') {
        instance_error(&wanted, "fmi2Instantiate: the instance name is missing");
        return NULL;
    }
    if (fmuType != fmi2CoSimulation && fmuType != fmi2ModelExchange) {
        instance_error(&wanted, "fmi2Instantiate: type %d found, must be 0 or 1", (int)fmuType);
        return NULL;
    }
    return instance_create(&wanted, fmuGUID, fmuResourceLocation);
}

void fmi2FreeInstance(fmi2Component c) {
    instance_free(c);
}

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean toleranceDefined, fmi2Real tolerance, fmi2Real startTime,
                               fmi2Boolean stopTimeDefined, fmi2Real stopTime) {
    Instance *s = c;
    (void)toleranceDefined;
    (void)tolerance;
    if (!instance_allows(s, "fmi2SetupExperiment", INSTANTIATED)) {
        return fmi2Error;
    }
    if (!isfinite(startTime) || (stopTimeDefined && !(stopTime >= startTime))) {
        return (fmi2Status)instance_error(s, "fmi2SetupExperiment: from %g to %g s is no time span", startTime,
                                          stopTime);
    }
    s->time = startTime;
    return fmi2OK;
}

/* Go from one of the modes `from` to `to`. */
static fmi2Status enter(Instance *s, const char *function, int from, Mode to) {
    if (!instance_allows(s, function, from)) {
        return fmi2Error;
    }
    s->mode = to;
    return fmi2OK;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c) {
    return enter(c, "fmi2EnterInitializationMode", INSTANTIATED, INITIALIZATION);
}

fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
    const Instance *s = c;
    return enter(c, "fmi2ExitInitializationMode", INITIALIZATION,
                 s != NULL && s->kind == MODEL_EXCHANGE_2 ? EVENT : STEP);
}

fmi2Status fmi2Terminate(fmi2Component c) {
    return enter(c, "fmi2Terminate", FMI2_RUNNING, TERMINATED);
}

fmi2Status fmi2Reset(fmi2Component c) {
    if (c == NULL) {
        return fmi2Error;
    }
    instance_reset(c);
    return fmi2OK;
}

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *FMUstate) {
    Instance *s = c;
    if (s == NULL || !fmi2_given(s, "fmi2GetFMUstate", FMUstate)) {
        return fmi2Error;
    }
    return (fmi2Status)state_get(s, FMUstate);
}

fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate FMUstate) {
    return c == NULL ? fmi2Error : (fmi2Status)state_set(c, FMUstate);
}

fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *FMUstate) {
    if (c == NULL) {
        return fmi2Error;
    }
    state_free(FMUstate);
    return fmi2OK;
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate FMUstate, size_t *size) {
    Instance *s = c;
    if (s == NULL || !fmi2_given(s, "fmi2SerializedFMUstateSize", FMUstate)
        || !fmi2_given(s, "fmi2SerializedFMUstateSize", size)) {
        return fmi2Error;
    }
    return (fmi2Status)state_serialized_size(s, FMUstate, size);
}

fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate FMUstate, fmi2Byte serializedState[], size_t size) {
    Instance *s = c;
    if (s == NULL || !fmi2_given(s, "fmi2SerializeFMUstate", serializedState)) {
        return fmi2Error;
    }
    return (fmi2Status)state_serialize(s, FMUstate, serializedState, size);
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte serializedState[], size_t size,
                                   fmi2FMUstate *FMUstate) {
    Instance *s = c;
    if (s == NULL || !fmi2_given(s, "fmi2DeSerializeFMUstate", serializedState)
        || !fmi2_given(s, "fmi2DeSerializeFMUstate", FMUstate)) {
        return fmi2Error;
    }
    return (fmi2Status)state_deserialize(s, serializedState, size, FMUstate);
}

/* Model exchange. */

fmi2Status fmi2EnterEventMode(fmi2Component c) {
    return enter(c, "fmi2EnterEventMode", EVENT | CONTINUOUS_TIME, EVENT);
}

fmi2Status fmi2NewDiscreteStates(fmi2Component c, fmi2EventInfo *eventInfo) {
    Instance *s = c;
    if (!instance_allows(s, "fmi2NewDiscreteStates", EVENT) || !fmi2_given(s, "fmi2NewDiscreteStates", eventInfo)) {
        return fmi2Error;
    }
    memset(eventInfo, 0, sizeof *eventInfo);
    return fmi2OK;
}

fmi2Status fmi2EnterContinuousTimeMode(fmi2Component c) {
    return enter(c, "fmi2EnterContinuousTimeMode", EVENT, CONTINUOUS_TIME);
}

fmi2Status fmi2CompletedIntegratorStep(fmi2Component c, fmi2Boolean noSetFMUStatePriorToCurrentPoint,
                                       fmi2Boolean *enterEventMode, fmi2Boolean *terminateSimulation) {
    static const char NAME[] = "fmi2CompletedIntegratorStep";
    Instance *s = c;
    (void)noSetFMUStatePriorToCurrentPoint;
    if (!instance_allows(s, NAME, CONTINUOUS_TIME) || !fmi2_given(s, NAME, enterEventMode)
        || !fmi2_given(s, NAME, terminateSimulation)) {
        return fmi2Error;
    }
    *enterEventMode = *terminateSimulation = fmi2False;
    instance_log_health(s);
    return fmi2OK;
}

fmi2Status fmi2SetTime(fmi2Component c, fmi2Real time) {
    Instance *s = c;
    if (!instance_allows(s, "fmi2SetTime", EVENT | CONTINUOUS_TIME)) {
        return fmi2Error;
    }
    if (!isfinite(time)) {
        return (fmi2Status)instance_error(s, "fmi2SetTime: %g is no time", time);
    }
    s->time = time;
    return fmi2OK;
}

/* There are no continuous states and no event indicators: lists of them are empty. */
static fmi2Status empty(Instance *s, const char *function, int modes, size_t length) {
    if (!instance_allows(s, function, modes)) {
        return fmi2Error;
    }
    return length == 0 ? fmi2OK
                       : (fmi2Status)instance_error(s, "%s: length %lu found, must be 0", function,
                                                    (unsigned long)length);
}

fmi2Status fmi2SetContinuousStates(fmi2Component c, const fmi2Real x[], size_t nx) {
    (void)x;
    return empty(c, "fmi2SetContinuousStates", CONTINUOUS_TIME, nx);
}

fmi2Status fmi2GetDerivatives(fmi2Component c, fmi2Real derivatives[], size_t nx) {
    (void)derivatives;
    return empty(c, "fmi2GetDerivatives", FMI2_READABLE, nx);
}

fmi2Status fmi2GetEventIndicators(fmi2Component c, fmi2Real eventIndicators[], size_t ni) {
    (void)eventIndicators;
    return empty(c, "fmi2GetEventIndicators", FMI2_READABLE, ni);
}

fmi2Status fmi2GetContinuousStates(fmi2Component c, fmi2Real x[], size_t nx) {
    (void)x;
    return empty(c, "fmi2GetContinuousStates", FMI2_READABLE, nx);
}

fmi2Status fmi2GetNominalsOfContinuousStates(fmi2Component c, fmi2Real x_nominal[], size_t nx) {
    (void)x_nominal;
    return empty(c, "fmi2GetNominalsOfContinuousStates", FMI2_READABLE, nx);
}

/* Co-simulation. */

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real currentCommunicationPoint, fmi2Real communicationStepSize,
                      fmi2Boolean noSetFMUStatePriorToCurrentPoint) {
    Instance *s = c;
    (void)noSetFMUStatePriorToCurrentPoint;
    if (!instance_allows(s, "fmi2DoStep", STEP)) {
        return fmi2Error;
    }
    const double end = currentCommunicationPoint + communicationStepSize;
    if (!(communicationStepSize > 0.0) || !isfinite(end)) {
        return (fmi2Status)instance_error(s, "fmi2DoStep: a step of %g s from %g s found, must be positive",
                                          communicationStepSize, currentCommunicationPoint);
    }
    s->time = end;
    instance_log_health(s);
    return fmi2OK;
}

/* What the model description does not offer. */
static fmi2Status not_offered(const Instance *s, const char *function) {
    return s == NULL ? fmi2Error : (fmi2Status)instance_error(s, "%s is not supported by this FMU", function);
}

fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                                       const fmi2Integer order[], const fmi2Real value[]) {
    (void)vr;
    (void)order;
    (void)value;
    return nvr == 0 && c != NULL ? fmi2OK : not_offered(c, "fmi2SetRealInputDerivatives");
}

fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                                        const fmi2Integer order[], fmi2Real value[]) {
    (void)vr;
    (void)order;
    (void)value;
    return nvr == 0 && c != NULL ? fmi2OK : not_offered(c, "fmi2GetRealOutputDerivatives");
}

fmi2Status fmi2CancelStep(fmi2Component c) {
    return not_offered(c, "fmi2CancelStep");
}

/* No step is ever pending, so the status of steps is known only by fmi2DoStep itself. */
fmi2Status fmi2GetStatus(fmi2Component c, const fmi2StatusKind s, fmi2Status *value) {
    (void)s;
    (void)value;
    return c == NULL ? fmi2Error : fmi2Discard;
}

fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind s, fmi2Real *value) {
    const Instance *instance = c;
    if (instance == NULL || value == NULL) {
        return fmi2Error;
    }
    if (s != fmi2LastSuccessfulTime) {
        return fmi2Discard;
    }
    *value = instance->time;
    return fmi2OK;
}

fmi2Status fmi2GetIntegerStatus(fmi2Component c, const fmi2StatusKind s, fmi2Integer *value) {
    (void)s;
    (void)value;
    return c == NULL ? fmi2Error : fmi2Discard;
}

fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind s, fmi2Boolean *value) {
    if (c == NULL || value == NULL) {
        return fmi2Error;
    }
    if (s != fmi2Terminated) {
        return fmi2Discard;
    }
    *value = fmi2False;
    return fmi2OK;
}

fmi2Status fmi2GetStringStatus(fmi2Component c, const fmi2StatusKind s, fmi2String *value) {
    (void)s;
    (void)value;
    return c == NULL ? fmi2Error : fmi2Discard;
}
