/* FMI 3.0: instances, modes, steps and states. Co-simulation and model exchange, without events of its own. */

#include <math.h>
#include <string.h>

#include "fmi3_common.h"
#include "instance_state.h"

static void write_message(const Instance *instance, int status, const char *category, const char *text) {
    fmi3LogMessageCallback logger = (fmi3LogMessageCallback)instance->logger;
    if (logger != NULL) {
        logger(instance->environment, (fmi3Status)status, category, text);
    }
}

const char *fmi3GetVersion(void) {
    return fmi3Version;
}

fmi3Status fmi3SetDebugLogging(fmi3Instance instance, fmi3Boolean loggingOn, size_t nCategories,
                               const fmi3String categories[]) {
    Instance *s = instance;
    if (s == NULL || (nCategories > 0 && !fmi3_given(s, "fmi3SetDebugLogging", categories))) {
        return fmi3Error;
    }
    s->events_logged = loggingOn && nCategories == 0;
    for (size_t i = 0; i < nCategories; i++) {
        if (categories[i] != NULL && strcmp(categories[i], CATEGORY_EVENTS) == 0) {
            s->events_logged = loggingOn;
        }
    }
    return fmi3OK;
}

static fmi3Instance instantiate(Kind kind, fmi3String name, fmi3String token, fmi3String path, int event_mode_used,
                                fmi3Boolean loggingOn, fmi3InstanceEnvironment environment,
                                fmi3LogMessageCallback logMessage) {
    const Instance wanted = {
        .kind = kind,
        .name = name != NULL ? name : "",
        .write = write_message,
        .logger = (void (*)(void))logMessage,
        .environment = environment,
        .event_mode_used = event_mode_used,
        .events_logged = loggingOn,
    };
    if (name == NULL || name[0] == '\0') {
        instance_error(&wanted, "the instance name is missing");
        return NULL;
    }
    return instance_create(&wanted, token, path);
}

fmi3Instance fmi3InstantiateModelExchange(fmi3String instanceName, fmi3String instantiationToken,
                                          fmi3String resourcePath, fmi3Boolean visible, fmi3Boolean loggingOn,
                                          fmi3InstanceEnvironment instanceEnvironment,
                                          fmi3LogMessageCallback logMessage) {
    (void)visible;
    return instantiate(MODEL_EXCHANGE_3, instanceName, instantiationToken, resourcePath, 1, loggingOn,
                       instanceEnvironment, logMessage);
}

fmi3Instance fmi3InstantiateCoSimulation(fmi3String instanceName, fmi3String instantiationToken,
                                         fmi3String resourcePath, fmi3Boolean visible, fmi3Boolean loggingOn,
                                         fmi3Boolean eventModeUsed, fmi3Boolean earlyReturnAllowed,
                                         const fmi3ValueReference requiredIntermediateVariables[],
                                         size_t nRequiredIntermediateVariables,
                                         fmi3InstanceEnvironment instanceEnvironment,
                                         fmi3LogMessageCallback logMessage,
                                         fmi3IntermediateUpdateCallback intermediateUpdate) {
    (void)visible;
    (void)earlyReturnAllowed;
    (void)requiredIntermediateVariables;
    (void)nRequiredIntermediateVariables;
    (void)intermediateUpdate;
    return instantiate(CO_SIMULATION_3, instanceName, instantiationToken, resourcePath, eventModeUsed, loggingOn,
                       instanceEnvironment, logMessage);
}

void fmi3FreeInstance(fmi3Instance instance) {
    instance_free(instance);
}

/* Go from one of the modes `from` to `to`. */
static fmi3Status enter(Instance *s, const char *function, int from, Mode to) {
    if (!instance_allows(s, function, from)) {
        return fmi3Error;
    }
    s->mode = to;
    return fmi3OK;
}

fmi3Status fmi3EnterInitializationMode(fmi3Instance instance, fmi3Boolean toleranceDefined, fmi3Float64 tolerance,
                                       fmi3Float64 startTime, fmi3Boolean stopTimeDefined, fmi3Float64 stopTime) {
    static const char NAME[] = "fmi3EnterInitializationMode";
    Instance *s = instance;
    (void)toleranceDefined;
    (void)tolerance;
    if (!instance_allows(s, NAME, INSTANTIATED)) {
        return fmi3Error;
    }
    if (!isfinite(startTime) || (stopTimeDefined && !(stopTime >= startTime))) {
        return (fmi3Status)instance_error(s, "%s: from %g to %g s is no time span", NAME, startTime, stopTime);
    }
    s->time = startTime;
    s->mode = INITIALIZATION;
    return fmi3OK;
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance instance) {
    const Instance *s = instance;
    return enter(instance, "fmi3ExitInitializationMode", INITIALIZATION,
                 s != NULL && s->event_mode_used ? EVENT : STEP);
}

fmi3Status fmi3EnterEventMode(fmi3Instance instance) {
    const Instance *s = instance;
    return enter(instance, "fmi3EnterEventMode", s != NULL && s->event_mode_used ? FMI3_RUNNING : 0, EVENT);
}

fmi3Status fmi3EnterConfigurationMode(fmi3Instance instance) {
    return enter(instance, "fmi3EnterConfigurationMode", INSTANTIATED, CONFIGURATION);
}

fmi3Status fmi3ExitConfigurationMode(fmi3Instance instance) {
    return enter(instance, "fmi3ExitConfigurationMode", CONFIGURATION, INSTANTIATED);
}

fmi3Status fmi3Terminate(fmi3Instance instance) {
    return enter(instance, "fmi3Terminate", FMI3_RUNNING, TERMINATED);
}

fmi3Status fmi3Reset(fmi3Instance instance) {
    if (instance == NULL) {
        return fmi3Error;
    }
    instance_reset(instance);
    return fmi3OK;
}

fmi3Status fmi3EvaluateDiscreteStates(fmi3Instance instance) {
    return instance_allows(instance, "fmi3EvaluateDiscreteStates", INITIALIZATION | EVENT) ? fmi3OK : fmi3Error;
}

fmi3Status fmi3UpdateDiscreteStates(fmi3Instance instance, fmi3Boolean *discreteStatesNeedUpdate,
                                    fmi3Boolean *terminateSimulation, fmi3Boolean *nominalsOfContinuousStatesChanged,
                                    fmi3Boolean *valuesOfContinuousStatesChanged, fmi3Boolean *nextEventTimeDefined,
                                    fmi3Float64 *nextEventTime) {
    if (!instance_allows(instance, "fmi3UpdateDiscreteStates", EVENT)) {
        return fmi3Error;
    }
    fmi3Boolean *const answers[] = {discreteStatesNeedUpdate, terminateSimulation, nominalsOfContinuousStatesChanged,
                                    valuesOfContinuousStatesChanged, nextEventTimeDefined};
    for (size_t i = 0; i < sizeof answers / sizeof *answers; i++) {
        if (answers[i] != NULL) {
            *answers[i] = fmi3False;
        }
    }
    if (nextEventTime != NULL) {
        *nextEventTime = 0.0;
    }
    return fmi3OK;
}

/* States of the FMU. */

fmi3Status fmi3GetFMUState(fmi3Instance instance, fmi3FMUState *FMUState) {
    if (instance == NULL || !fmi3_given(instance, "fmi3GetFMUState", FMUState)) {
        return fmi3Error;
    }
    return (fmi3Status)state_get(instance, FMUState);
}

fmi3Status fmi3SetFMUState(fmi3Instance instance, fmi3FMUState FMUState) {
    return instance == NULL ? fmi3Error : (fmi3Status)state_set(instance, FMUState);
}

fmi3Status fmi3FreeFMUState(fmi3Instance instance, fmi3FMUState *FMUState) {
    if (instance == NULL) {
        return fmi3Error;
    }
    state_free(FMUState);
    return fmi3OK;
}

fmi3Status fmi3SerializedFMUStateSize(fmi3Instance instance, fmi3FMUState FMUState, size_t *size) {
    static const char NAME[] = "fmi3SerializedFMUStateSize";
    if (instance == NULL || !fmi3_given(instance, NAME, FMUState) || !fmi3_given(instance, NAME, size)) {
        return fmi3Error;
    }
    return (fmi3Status)state_serialized_size(instance, FMUState, size);
}

fmi3Status fmi3SerializeFMUState(fmi3Instance instance, fmi3FMUState FMUState, fmi3Byte serializedState[],
                                 size_t size) {
    if (instance == NULL || !fmi3_given(instance, "fmi3SerializeFMUState", serializedState)) {
        return fmi3Error;
    }
    return (fmi3Status)state_serialize(instance, FMUState, serializedState, size);
}

fmi3Status fmi3DeserializeFMUState(fmi3Instance instance, const fmi3Byte serializedState[], size_t size,
                                   fmi3FMUState *FMUState) {
    static const char NAME[] = "fmi3DeserializeFMUState";
    if (instance == NULL || !fmi3_given(instance, NAME, serializedState) || !fmi3_given(instance, NAME, FMUState)) {
        return fmi3Error;
    }
    return (fmi3Status)state_deserialize(instance, serializedState, size, FMUState);
}

/* Model exchange: no continuous states, no event indicators. */

fmi3Status fmi3EnterContinuousTimeMode(fmi3Instance instance) {
    const Instance *s = instance;
    const int allowed = s != NULL && s->kind == MODEL_EXCHANGE_3;
    return enter(instance, "fmi3EnterContinuousTimeMode", allowed ? EVENT : 0, CONTINUOUS_TIME);
}

fmi3Status fmi3CompletedIntegratorStep(fmi3Instance instance, fmi3Boolean noSetFMUStatePriorToCurrentPoint,
                                       fmi3Boolean *enterEventMode, fmi3Boolean *terminateSimulation) {
    static const char NAME[] = "fmi3CompletedIntegratorStep";
    (void)noSetFMUStatePriorToCurrentPoint;
    if (!instance_allows(instance, NAME, CONTINUOUS_TIME) || !fmi3_given(instance, NAME, enterEventMode)
        || !fmi3_given(instance, NAME, terminateSimulation)) {
        return fmi3Error;
    }
    *enterEventMode = *terminateSimulation = fmi3False;
    instance_log_health(instance);
    return fmi3OK;
}

fmi3Status fmi3SetTime(fmi3Instance instance, fmi3Float64 time) {
    Instance *s = instance;
    if (!instance_allows(s, "fmi3SetTime", EVENT | CONTINUOUS_TIME)) {
        return fmi3Error;
    }
    if (!isfinite(time)) {
        return (fmi3Status)instance_error(s, "fmi3SetTime: %g is no time", time);
    }
    s->time = time;
    return fmi3OK;
}

static fmi3Status empty(Instance *s, const char *function, int modes, size_t length) {
    if (!instance_allows(s, function, modes)) {
        return fmi3Error;
    }
    return length == 0 ? fmi3OK
                       : (fmi3Status)instance_error(s, "%s: length %lu found, must be 0", function,
                                                    (unsigned long)length);
}

fmi3Status fmi3SetContinuousStates(fmi3Instance instance, const fmi3Float64 continuousStates[],
                                   size_t nContinuousStates) {
    (void)continuousStates;
    return empty(instance, "fmi3SetContinuousStates", CONTINUOUS_TIME, nContinuousStates);
}

fmi3Status fmi3GetContinuousStateDerivatives(fmi3Instance instance, fmi3Float64 derivatives[],
                                             size_t nContinuousStates) {
    (void)derivatives;
    return empty(instance, "fmi3GetContinuousStateDerivatives", FMI3_READABLE, nContinuousStates);
}

fmi3Status fmi3GetEventIndicators(fmi3Instance instance, fmi3Float64 eventIndicators[], size_t nEventIndicators) {
    (void)eventIndicators;
    return empty(instance, "fmi3GetEventIndicators", FMI3_READABLE, nEventIndicators);
}

fmi3Status fmi3GetContinuousStates(fmi3Instance instance, fmi3Float64 continuousStates[], size_t nContinuousStates) {
    (void)continuousStates;
    return empty(instance, "fmi3GetContinuousStates", FMI3_READABLE, nContinuousStates);
}

fmi3Status fmi3GetNominalsOfContinuousStates(fmi3Instance instance, fmi3Float64 nominals[], size_t nContinuousStates) {
    (void)nominals;
    return empty(instance, "fmi3GetNominalsOfContinuousStates", FMI3_READABLE, nContinuousStates);
}

static fmi3Status none(Instance *s, const char *function, size_t *number) {
    if (s == NULL || !fmi3_given(s, function, number)) {
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

/* Co-simulation. */

fmi3Status fmi3EnterStepMode(fmi3Instance instance) {
    const Instance *s = instance;
    const int allowed = s != NULL && s->kind == CO_SIMULATION_3;
    return enter(instance, "fmi3EnterStepMode", allowed ? EVENT : 0, STEP);
}

fmi3Status fmi3DoStep(fmi3Instance instance, fmi3Float64 currentCommunicationPoint,
                      fmi3Float64 communicationStepSize, fmi3Boolean noSetFMUStatePriorToCurrentPoint,
                      fmi3Boolean *eventHandlingNeeded, fmi3Boolean *terminateSimulation, fmi3Boolean *earlyReturn,
                      fmi3Float64 *lastSuccessfulTime) {
    Instance *s = instance;
    (void)noSetFMUStatePriorToCurrentPoint;
    if (!instance_allows(s, "fmi3DoStep", STEP) || !fmi3_given(s, "fmi3DoStep", eventHandlingNeeded)
        || !fmi3_given(s, "fmi3DoStep", terminateSimulation) || !fmi3_given(s, "fmi3DoStep", earlyReturn)
        || !fmi3_given(s, "fmi3DoStep", lastSuccessfulTime)) {
        return fmi3Error;
    }
    const double end = currentCommunicationPoint + communicationStepSize;
    if (!(communicationStepSize > 0.0) || !isfinite(end)) {
        return (fmi3Status)instance_error(s, "fmi3DoStep: a step of %g s from %g s found, must be positive",
                                          communicationStepSize, currentCommunicationPoint);
    }
    s->time = *lastSuccessfulTime = end;
    *eventHandlingNeeded = *terminateSimulation = *earlyReturn = fmi3False;
    instance_log_health(s);
    return fmi3OK;
}
