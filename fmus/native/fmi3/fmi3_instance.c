/* FMI 3.0: instances and their modes, steps, events, states. */

#include "fmi3.h"

#define FMI(name) fmi3##name
#define FMI_INSTANCE fmi3Instance
#define FMU_STATE(verb) fmi3##verb##FMUState
#define FMU_STATE_SIZE fmi3SerializedFMUStateSize
#define FMU_STATE_OF_BYTES fmi3DeserializeFMUState
#define STATE_DERIVATIVES fmi3GetContinuousStateDerivatives

#include "../core/front.h"

static void write_message(const Instance *instance, int status, const char *category, const char *text) {
    fmi3LogMessageCallback logger = (fmi3LogMessageCallback)instance->logger;
    if (logger != NULL) {
        logger(instance->environment, (fmi3Status)status, category, text);
    }
}

const char *fmi3GetVersion(void) {
    return fmi3Version;
}

static fmi3Instance instantiate(Kind kind, fmi3String name, fmi3String token, fmi3String path, fmi3Boolean eventModeUsed,
                                fmi3Boolean loggingOn, fmi3InstanceEnvironment environment,
                                fmi3LogMessageCallback logMessage) {
    const Instance requested = {
        .kind = kind,
        .name = name != NULL ? name : "",
        .write = write_message,
        .logger = (void (*)(void))logMessage,
        .environment = environment,
        .events_logged = loggingOn,
        .kinds = NODE_KINDS,
    };
    Instance *instance = instance_create(&requested, token, path);
    if (instance != NULL && kind == CO_SIMULATION_3 && (instance->node != NULL) != (eventModeUsed != 0)) {
        instance_error(&requested, eventModeUsed ? "event mode was requested, which this FMU has in model exchange only"
                                                 : "this FMU exchanges frames in event mode: eventModeUsed must be true");
        instance_free(instance);
        return NULL;
    }
    return instance;
}

fmi3Instance fmi3InstantiateModelExchange(fmi3String instanceName, fmi3String instantiationToken,
                                          fmi3String resourcePath, fmi3Boolean visible, fmi3Boolean loggingOn,
                                          fmi3InstanceEnvironment instanceEnvironment,
                                          fmi3LogMessageCallback logMessage) {
    (void)visible;
    return instantiate(MODEL_EXCHANGE_3, instanceName, instantiationToken, resourcePath, fmi3True, loggingOn,
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

fmi3Status fmi3EnterInitializationMode(fmi3Instance instance, fmi3Boolean toleranceDefined, fmi3Float64 tolerance,
                                       fmi3Float64 startTime, fmi3Boolean stopTimeDefined, fmi3Float64 stopTime) {
    (void)toleranceDefined;
    (void)tolerance;
    if (instance_start_at(instance, __func__, startTime, stopTimeDefined, stopTime) != STATUS_OK) {
        return fmi3Error;
    }
    return (fmi3Status)instance_enter(instance, __func__, INSTANTIATED, INITIALIZATION);
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance instance) {
    const Instance *s = instance;
    const int has_events = s != NULL && (s->kind == MODEL_EXCHANGE_3 || s->node != NULL);
    return (fmi3Status)instance_end_initialization(instance, __func__, has_events ? EVENT : STEP);
}

fmi3Status fmi3EnterEventMode(fmi3Instance instance) {
    const Instance *s = instance;
    const int from = s == NULL ? 0 : s->kind == MODEL_EXCHANGE_3 ? EVENT | CONTINUOUS_TIME : s->node != NULL ? STEP : 0;
    return (fmi3Status)instance_enter(instance, __func__, from, EVENT);
}

fmi3Status fmi3EnterConfigurationMode(fmi3Instance instance) {
    return (fmi3Status)instance_enter(instance, __func__, INSTANTIATED, CONFIGURATION);
}

fmi3Status fmi3ExitConfigurationMode(fmi3Instance instance) {
    return (fmi3Status)instance_enter(instance, __func__, CONFIGURATION, INSTANTIATED);
}

fmi3Status fmi3EvaluateDiscreteStates(fmi3Instance instance) {
    return instance_allows(instance, __func__, INITIALIZATION | EVENT) ? fmi3OK : fmi3Error;
}

fmi3Status fmi3UpdateDiscreteStates(fmi3Instance instance, fmi3Boolean *discreteStatesNeedUpdate,
                                    fmi3Boolean *terminateSimulation, fmi3Boolean *nominalsOfContinuousStatesChanged,
                                    fmi3Boolean *valuesOfContinuousStatesChanged, fmi3Boolean *nextEventTimeDefined,
                                    fmi3Float64 *nextEventTime) {
    if (!instance_allows(instance, __func__, EVENT)) {
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
    instance_follow_event(instance);
    return fmi3OK;
}

/* Co-simulation. */

fmi3Status fmi3EnterStepMode(fmi3Instance instance) {
    const Instance *s = instance;
    const int allowed = s != NULL && s->kind == CO_SIMULATION_3;
    return (fmi3Status)instance_enter(instance, __func__, allowed ? EVENT : 0, STEP);
}

fmi3Status fmi3DoStep(fmi3Instance instance, fmi3Float64 currentCommunicationPoint,
                      fmi3Float64 communicationStepSize, fmi3Boolean noSetFMUStatePriorToCurrentPoint,
                      fmi3Boolean *eventHandlingNeeded, fmi3Boolean *terminateSimulation, fmi3Boolean *earlyReturn,
                      fmi3Float64 *lastSuccessfulTime) {
    Instance *s = instance;
    (void)noSetFMUStatePriorToCurrentPoint;
    if (!instance_allows(s, __func__, STEP) || !instance_given(s, __func__, eventHandlingNeeded)
        || !instance_given(s, __func__, terminateSimulation) || !instance_given(s, __func__, earlyReturn)
        || !instance_given(s, __func__, lastSuccessfulTime)) {
        return fmi3Error;
    }
    const int status = instance_step(s, __func__, currentCommunicationPoint, communicationStepSize);
    if (status != STATUS_ERROR) {
        *eventHandlingNeeded = fmi3_is_due(s) ? fmi3True : fmi3False;
        *earlyReturn = fmi3False;
        *terminateSimulation = s->ending ? fmi3True : fmi3False;
        *lastSuccessfulTime = s->ending ? s->last_successful_time : s->model->time;
    }
    return (fmi3Status)status;
}

/* Model exchange. */

fmi3Status fmi3EnterContinuousTimeMode(fmi3Instance instance) {
    const Instance *s = instance;
    const int allowed = s != NULL && s->kind == MODEL_EXCHANGE_3;
    return (fmi3Status)instance_go_on(instance, __func__, allowed ? EVENT : 0);
}

static fmi3Status none(Instance *s, const char *function, size_t *number) {
    if (s == NULL || !instance_given(s, function, number)) {
        return fmi3Error;
    }
    *number = 0;
    return fmi3OK;
}

fmi3Status fmi3GetNumberOfEventIndicators(fmi3Instance instance, size_t *nEventIndicators) {
    return none(instance, __func__, nEventIndicators);
}

fmi3Status fmi3GetNumberOfContinuousStates(fmi3Instance instance, size_t *nContinuousStates) {
    return none(instance, __func__, nContinuousStates);
}
