/* The front of FMI 2.0.5: instances and their modes, steps, events, states, variables, derivatives. Each function names
   itself and the modes in which it is allowed, and hands its arguments to the core. A value reference is the number of a
   variable. */

#include "fmi2Functions.h"

#include <string.h>

#define FMI(name) fmi2##name
#define FMI_INSTANCE fmi2Component
#define FMU_STATE(verb) fmi2##verb##FMUstate
#define FMU_STATE_SIZE fmi2SerializedFMUstateSize
#define FMU_STATE_OF_BYTES fmi2DeSerializeFMUstate
#define STATE_DERIVATIVES fmi2GetDerivatives

#include "../core/front.h"

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

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean toleranceDefined, fmi2Real tolerance, fmi2Real startTime,
                               fmi2Boolean stopTimeDefined, fmi2Real stopTime) {
    (void)toleranceDefined;
    (void)tolerance;
    return (fmi2Status)instance_start_at(c, __func__, startTime, stopTimeDefined, stopTime);
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c) {
    return (fmi2Status)instance_enter(c, __func__, INSTANTIATED, INITIALIZATION);
}

fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
    const Instance *s = c;
    return (fmi2Status)instance_end_initialization(c, __func__,
                                                   s != NULL && s->kind == MODEL_EXCHANGE_2 ? EVENT : STEP);
}

/* Co-simulation. */

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real currentCommunicationPoint, fmi2Real communicationStepSize,
                      fmi2Boolean noSetFMUStatePriorToCurrentPoint) {
    (void)noSetFMUStatePriorToCurrentPoint;
    return (fmi2Status)instance_step(c, __func__, currentCommunicationPoint, communicationStepSize);
}

#define NO_DERIVATIVES_BY_TIME(function, Values)                                                               \
    fmi2Status function(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2Integer order[], \
                        Values value[]) {                                                                      \
        (void)vr;                                                                                              \
        (void)order;                                                                                           \
        (void)value;                                                                                           \
        return nvr == 0 && c != NULL ? fmi2OK : (fmi2Status)instance_not_offered(c, #function);                \
    }
NO_DERIVATIVES_BY_TIME(fmi2SetRealInputDerivatives, const fmi2Real)
NO_DERIVATIVES_BY_TIME(fmi2GetRealOutputDerivatives, fmi2Real)

fmi2Status fmi2CancelStep(fmi2Component c) {
    return (fmi2Status)instance_not_offered(c, __func__);
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

/* Model exchange. */

fmi2Status fmi2EnterEventMode(fmi2Component c) {
    return (fmi2Status)instance_enter(c, __func__, EVENT | CONTINUOUS_TIME, EVENT);
}

fmi2Status fmi2NewDiscreteStates(fmi2Component c, fmi2EventInfo *eventInfo) {
    if (!instance_allows(c, __func__, EVENT) || !instance_given(c, __func__, eventInfo)) {
        return fmi2Error;
    }
    instance_follow_event(c);
    memset(eventInfo, 0, sizeof *eventInfo);
    return fmi2OK;
}

fmi2Status fmi2EnterContinuousTimeMode(fmi2Component c) {
    return (fmi2Status)instance_go_on(c, __func__, EVENT);
}

/* The variables of a list; a run if they follow each other without a gap. */
static Selection selection_of(const fmi2ValueReference vr[], size_t nvr) {
    unsigned gaps = 0;
    for (size_t k = 0; k < nvr; k++) {
        gaps |= vr[k] ^ (vr[0] + (unsigned)k);
    }
    return nvr > 0 && gaps == 0 ? (Selection){NULL, vr[0], nvr} : (Selection){vr, 0, nvr};
}

/* Read or set variables of a type, by a function of that name. There are no Strings: lists of them are empty. */
static fmi2Status get(Instance *s, const char *function, Type type, const fmi2ValueReference vr[], size_t nvr, void *value) {
    char text[MODEL_TEXT_SIZE];
    if (!instance_allows(s, function, READABLE) || !instance_lists(s, function, nvr, vr, value)) {
        return fmi2Error;
    }
    const Selection which = selection_of(vr, nvr);
    return model_get(s->model, type, &which, value, text) ? fmi2OK : (fmi2Status)instance_error(s, "%s: %s", function, text);
}

static fmi2Status set(Instance *s, const char *function, Type type, const fmi2ValueReference vr[], size_t nvr,
                      const void *value) {
    char text[MODEL_TEXT_SIZE];
    if (!instance_allows(s, function, SETTABLE) || !instance_lists(s, function, nvr, vr, value)) {
        return fmi2Error;
    }
    const Selection which = selection_of(vr, nvr);
    return model_set(s->model, type, &which, value, text) ? fmi2OK : (fmi2Status)instance_error(s, "%s: %s", function, text);
}

#define GET_AND_SET(Name, type)                                                                                      \
    fmi2Status fmi2Get##Name(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2##Name value[]) {       \
        return get(c, __func__, type, vr, nvr, value);                                                               \
    }                                                                                                                \
    fmi2Status fmi2Set##Name(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2##Name value[]) { \
        return set(c, __func__, type, vr, nvr, value);                                                               \
    }
GET_AND_SET(Real, REAL)
GET_AND_SET(Integer, INTEGER)
GET_AND_SET(Boolean, BOOLEAN)
GET_AND_SET(String, TEXT)

/* A value reference is the number of its variable. */
static Selection variable_of_reference(const Instance *s, unsigned reference) {
    (void)s;
    return (Selection){NULL, reference, 1};
}

fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference vUnknown_ref[], size_t nUnknown,
                                        const fmi2ValueReference vKnown_ref[], size_t nKnown, const fmi2Real dvKnown[],
                                        fmi2Real dvUnknown[]) {
    const References unknowns = {vUnknown_ref, nUnknown, nUnknown, variable_of_reference};
    const References knowns = {vKnown_ref, nKnown, nKnown, variable_of_reference};
    return (fmi2Status)instance_derivative(c, __func__, &unknowns, &knowns, dvKnown, dvUnknown, 0);
}
