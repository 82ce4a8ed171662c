/* FMI 2.0.5: instances and their modes. */

#include "fmi2.h"

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
    return (fmi2Status)instance_set_logging(c, "fmi2SetDebugLogging", loggingOn != fmi2False, nCategories, categories);
}

fmi2Component fmi2Instantiate(fmi2String instanceName, fmi2Type fmuType, fmi2String fmuGUID,
                              fmi2String fmuResourceLocation, const fmi2CallbackFunctions *functions,
                              fmi2Boolean visible, fmi2Boolean loggingOn) {
    (void)visible;
    if (functions == NULL) {
        return NULL;
    }
    const Instance requested = {
        .kind = fmuType == fmi2CoSimulation ? CO_SIMULATION_2 : MODEL_EXCHANGE_2,
        .name = instanceName != NULL ? instanceName : "",
        .write = write_message,
        .logger = (void (*)(void))functions->logger,
        .environment = functions->componentEnvironment,
        .events_logged = loggingOn != fmi2False,
    };
    if (fmuType != fmi2CoSimulation && fmuType != fmi2ModelExchange) {
        instance_error(&requested, "fmi2Instantiate: type %d found, must be 0 or 1", (int)fmuType);
        return NULL;
    }
    return instance_create(&requested, fmuGUID, fmuResourceLocation);
}

void fmi2FreeInstance(fmi2Component c) {
    instance_free(c);
}

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean toleranceDefined, fmi2Real tolerance, fmi2Real startTime,
                               fmi2Boolean stopTimeDefined, fmi2Real stopTime) {
    (void)toleranceDefined;
    (void)tolerance;
    return (fmi2Status)instance_start_at(c, "fmi2SetupExperiment", startTime, stopTimeDefined, stopTime);
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c) {
    return (fmi2Status)instance_enter(c, "fmi2EnterInitializationMode", INSTANTIATED, INITIALIZATION);
}

fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
    const Instance *s = c;
    return (fmi2Status)instance_end_initialization(c, "fmi2ExitInitializationMode",
                                                   s != NULL && s->kind == MODEL_EXCHANGE_2 ? EVENT : STEP);
}

fmi2Status fmi2Terminate(fmi2Component c) {
    return (fmi2Status)instance_enter(c, "fmi2Terminate", FMI2_RUNNING, TERMINATED);
}

fmi2Status fmi2Reset(fmi2Component c) {
    if (c == NULL) {
        return fmi2Error;
    }
    instance_reset(c);
    return fmi2OK;
}
