/* Functions that both FMI versions have, under names that differ by the prefix: a front includes this file once, after it has
   defined

       FMI(name)                 the name with the prefix of its version
       FMI_INSTANCE              the type of an instance
       FMU_STATE(verb)           the function of FMU states that a verb names; without a verb, their type
       FMU_STATE_SIZE, FMU_STATE_OF_BYTES, STATE_DERIVATIVES    three names that differ in more than the prefix */

#ifndef FRONT_H
#define FRONT_H

#include "instance.h"
#include "state.h"

#define QUOTED(name) #name
#define TEXT_OF(function) QUOTED(function)

FMI(Status) FMI(SetDebugLogging)(FMI_INSTANCE c, FMI(Boolean) loggingOn, size_t nCategories, const FMI(String) categories[]) {
    return (FMI(Status))instance_set_logging(c, TEXT_OF(FMI(SetDebugLogging)), loggingOn != FMI(False), nCategories, categories);
}

void FMI(FreeInstance)(FMI_INSTANCE c) {
    instance_free(c);
}

FMI(Status) FMI(Terminate)(FMI_INSTANCE c) {
    return (FMI(Status))instance_enter(c, TEXT_OF(FMI(Terminate)), RUNNING, TERMINATED);
}

FMI(Status) FMI(Reset)(FMI_INSTANCE c) {
    if (c == NULL) {
        return FMI(Error);
    }
    instance_reset(c);
    return FMI(OK);
}

/* Model exchange, without continuous states and event indicators. */

FMI(Status) FMI(SetTime)(FMI_INSTANCE c, double time) {
    return (FMI(Status))instance_set_time(c, TEXT_OF(FMI(SetTime)), EVENT | CONTINUOUS_TIME, time);
}

FMI(Status) FMI(CompletedIntegratorStep)(FMI_INSTANCE c, FMI(Boolean) noSetFMUStatePriorToCurrentPoint,
                                         FMI(Boolean) *enterEventMode, FMI(Boolean) *terminateSimulation) {
    static const char NAME[] = TEXT_OF(FMI(CompletedIntegratorStep));
    (void)noSetFMUStatePriorToCurrentPoint;
    if (!instance_allows(c, NAME, CONTINUOUS_TIME) || !instance_given(c, NAME, enterEventMode)
        || !instance_given(c, NAME, terminateSimulation)) {
        return FMI(Error);
    }
    int event = 0;
    const FMI(Status) status = (FMI(Status))instance_end_solver_step(c, NAME, &event);
    *enterEventMode = event ? FMI(True) : FMI(False);
    *terminateSimulation = FMI(False);
    return status;
}

#define EMPTY_LIST(function, modes, Type)                                        \
    FMI(Status) function(FMI_INSTANCE c, Type values[], size_t n) {              \
        (void)values;                                                            \
        return (FMI(Status))instance_empty_list(c, TEXT_OF(function), modes, n); \
    }
EMPTY_LIST(FMI(SetContinuousStates), CONTINUOUS_TIME, const double)
EMPTY_LIST(STATE_DERIVATIVES, READABLE, double)
EMPTY_LIST(FMI(GetEventIndicators), READABLE, double)
EMPTY_LIST(FMI(GetContinuousStates), READABLE, double)
EMPTY_LIST(FMI(GetNominalsOfContinuousStates), READABLE, double)

/* FMU states. */

FMI(Status) FMU_STATE(Get)(FMI_INSTANCE c, FMU_STATE() *state) {
    return (FMI(Status))state_get(c, TEXT_OF(FMU_STATE(Get)), state);
}

FMI(Status) FMU_STATE(Set)(FMI_INSTANCE c, FMU_STATE() state) {
    return (FMI(Status))state_set(c, state);
}

FMI(Status) FMU_STATE(Free)(FMI_INSTANCE c, FMU_STATE() *state) {
    return (FMI(Status))state_free(c, state);
}

FMI(Status) FMU_STATE_SIZE(FMI_INSTANCE c, FMU_STATE() state, size_t *size) {
    return (FMI(Status))state_serialized_size(c, TEXT_OF(FMU_STATE_SIZE), state, size);
}

FMI(Status) FMU_STATE(Serialize)(FMI_INSTANCE c, FMU_STATE() state, FMI(Byte) bytes[], size_t size) {
    return (FMI(Status))state_serialize(c, TEXT_OF(FMU_STATE(Serialize)), state, bytes, size);
}

FMI(Status) FMU_STATE_OF_BYTES(FMI_INSTANCE c, const FMI(Byte) bytes[], size_t size, FMU_STATE() *state) {
    return (FMI(Status))state_deserialize(c, TEXT_OF(FMU_STATE_OF_BYTES), bytes, size, state);
}

#endif
