/* The front of FMI 2.0.5: instances and their modes, steps, events, states, variables, derivatives. Each function names
   itself and the modes in which it is allowed, and hands its arguments to the core. A value reference is the number of a
   variable. */

#include "fmi2Functions.h"

#include <string.h>

#include "../core/floating.h"
#include "../core/state.h"

#define FMI2_RUNNING (STEP | EVENT | CONTINUOUS_TIME)
#define FMI2_SETTABLE (INSTANTIATED | INITIALIZATION | FMI2_RUNNING)
#define FMI2_READABLE (FMI2_SETTABLE | TERMINATED)

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

/* Co-simulation. */

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

/* Model exchange, without continuous states and event indicators. */

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

/* FMU states. */

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *FMUstate) {
    return (fmi2Status)state_get(c, "fmi2GetFMUstate", FMUstate);
}

fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate FMUstate) {
    return (fmi2Status)state_set(c, FMUstate);
}

fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *FMUstate) {
    return (fmi2Status)state_free(c, FMUstate);
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate FMUstate, size_t *size) {
    return (fmi2Status)state_serialized_size(c, "fmi2SerializedFMUstateSize", FMUstate, size);
}

fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate FMUstate, fmi2Byte serializedState[], size_t size) {
    return (fmi2Status)state_serialize(c, "fmi2SerializeFMUstate", FMUstate, serializedState, size);
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte serializedState[], size_t size,
                                   fmi2FMUstate *FMUstate) {
    return (fmi2Status)state_deserialize(c, "fmi2DeSerializeFMUstate", serializedState, size, FMUstate);
}

/* The variables of a list; a run if they follow each other without a gap. */
static Selection selection_of(const fmi2ValueReference vr[], size_t nvr) {
    unsigned gaps = 0;
    for (size_t k = 0; k < nvr; k++) {
        gaps |= vr[k] ^ (vr[0] + (unsigned)k);
    }
    return nvr > 0 && gaps == 0 ? (Selection){NULL, vr[0], nvr} : (Selection){vr, 0, nvr};
}

/* Whether the lists of nvr value references and values are there, in one of the modes. */
static int lists_given(Instance *instance, const char *function, int modes, const void *vr, size_t nvr,
                       const void *value) {
    return instance_allows(instance, function, modes)
        && (nvr == 0 || (instance_given(instance, function, vr) && instance_given(instance, function, value)));
}

/* fmi2GetReal, fmi2SetReal and the like. Integers and Booleans are both int in C. */
#define GET(Type, get)                                                                                         \
    fmi2Status fmi2Get##Type(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2##Type value[]) { \
        Instance *s = c;                                                                                       \
        char text[MODEL_TEXT_SIZE];                                                                            \
        if (!lists_given(s, "fmi2Get" #Type, FMI2_READABLE, vr, nvr, value)) {                                 \
            return fmi2Error;                                                                                  \
        }                                                                                                      \
        const Selection which = selection_of(vr, nvr);                                                         \
        return get(s->model, &which, value, text)                                                              \
                 ? fmi2OK                                                                                      \
                 : (fmi2Status)instance_error(s, "fmi2Get" #Type ": %s", text);                                \
    }

#define SET(Type, set)                                                                                               \
    fmi2Status fmi2Set##Type(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2##Type value[]) { \
        Instance *s = c;                                                                                             \
        char text[MODEL_TEXT_SIZE];                                                                                  \
        if (!lists_given(s, "fmi2Set" #Type, FMI2_SETTABLE, vr, nvr, value)) {                                       \
            return fmi2Error;                                                                                        \
        }                                                                                                            \
        const Selection which = selection_of(vr, nvr);                                                               \
        return set(s->model, &which, value, text)                                                                    \
                 ? fmi2OK                                                                                            \
                 : (fmi2Status)instance_error(s, "fmi2Set" #Type ": %s", text);                                      \
    }

GET(Real, model_get_reals)
GET(Integer, model_get_integers)
GET(Boolean, model_get_booleans)
SET(Real, model_set_reals)
SET(Integer, model_set_integers)
SET(Boolean, model_set_booleans)

/* There are no Strings: lists of them are empty. */
static fmi2Status no_strings(Instance *s, const char *function, int modes, const fmi2ValueReference vr[], size_t nvr,
                             const void *value) {
    if (!lists_given(s, function, modes, vr, nvr, value)) {
        return fmi2Error;
    }
    return nvr == 0 ? fmi2OK : (fmi2Status)instance_error(s, "%s: " WRONG_TYPE, function, (unsigned long)vr[0]);
}

fmi2Status fmi2GetString(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2String value[]) {
    return no_strings(c, "fmi2GetString", FMI2_READABLE, vr, nvr, value);
}

fmi2Status fmi2SetString(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2String value[]) {
    return no_strings(c, "fmi2SetString", FMI2_SETTABLE, vr, nvr, value);
}

static fmi2Status no_derivative(const Instance *s, const char *function, fmi2ValueReference reference) {
    return (fmi2Status)instance_error(s, NO_DERIVATIVE "value reference %lu found", function, (unsigned long)reference);
}

static fmi2Status directional_derivative(Instance *s, const fmi2ValueReference vUnknown_ref[], size_t nUnknown,
                                         const fmi2ValueReference vKnown_ref[], size_t nKnown, const fmi2Real dvKnown[],
                                         fmi2Real dvUnknown[]) {
    static const char NAME[] = "fmi2GetDirectionalDerivative";
    const int modes = INITIALIZATION | FMI2_RUNNING;
    const Derivatives *derivatives = MODEL.derivatives;
    if (s == NULL || derivatives == NULL) {
        return (fmi2Status)instance_not_offered(s, NAME);
    }
    if (!lists_given(s, NAME, modes, vUnknown_ref, nUnknown, dvUnknown)
        || !lists_given(s, NAME, modes, vKnown_ref, nKnown, dvKnown)) {
        return fmi2Error;
    }
    double *direction = derivatives->clear_direction(s->model);
    for (size_t i = 0; i < nKnown; i++) {
        const size_t index = derivatives->input_index(s->model, vKnown_ref[i]);
        if (index == SIZE_MAX) {
            return no_derivative(s, NAME, vKnown_ref[i]);
        }
        direction[index] += dvKnown[i];
    }
    char text[MODEL_TEXT_SIZE];
    const double *derivative = derivatives->along_direction(s->model, text);
    if (derivative == NULL) {
        return (fmi2Status)instance_discard(s, NAME, text);
    }
    for (size_t i = 0; i < nUnknown; i++) {
        const size_t index = derivatives->output_index(s->model, vUnknown_ref[i]);
        if (index == SIZE_MAX) {
            return no_derivative(s, NAME, vUnknown_ref[i]);
        }
        dvUnknown[i] = derivative[index];
    }
    return fmi2OK;
}

fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference vUnknown_ref[], size_t nUnknown,
                                        const fmi2ValueReference vKnown_ref[], size_t nKnown, const fmi2Real dvKnown[],
                                        fmi2Real dvUnknown[]) {
    const Floating host = floating_enter();
    const fmi2Status status =
        directional_derivative(c, vUnknown_ref, nUnknown, vKnown_ref, nKnown, dvKnown, dvUnknown);
    floating_leave(&host);
    return status;
}
