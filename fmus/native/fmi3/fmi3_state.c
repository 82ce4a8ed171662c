/* FMI 3.0: FMU states. */

#include "fmi3.h"

#include "../core/state.h"

fmi3Status fmi3GetFMUState(fmi3Instance instance, fmi3FMUState *FMUState) {
    if (instance == NULL || !instance_given(instance, "fmi3GetFMUState", FMUState)) {
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
    if (instance == NULL || !instance_given(instance, NAME, FMUState) || !instance_given(instance, NAME, size)) {
        return fmi3Error;
    }
    return (fmi3Status)state_serialized_size(instance, FMUState, size);
}

fmi3Status fmi3SerializeFMUState(fmi3Instance instance, fmi3FMUState FMUState, fmi3Byte serializedState[],
                                 size_t size) {
    if (instance == NULL || !instance_given(instance, "fmi3SerializeFMUState", serializedState)) {
        return fmi3Error;
    }
    return (fmi3Status)state_serialize(instance, FMUState, serializedState, size);
}

fmi3Status fmi3DeserializeFMUState(fmi3Instance instance, const fmi3Byte serializedState[], size_t size,
                                   fmi3FMUState *FMUState) {
    static const char NAME[] = "fmi3DeserializeFMUState";
    if (instance == NULL || !instance_given(instance, NAME, serializedState)
        || !instance_given(instance, NAME, FMUState)) {
        return fmi3Error;
    }
    return (fmi3Status)state_deserialize(instance, serializedState, size, FMUState);
}
