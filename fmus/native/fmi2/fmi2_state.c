/* FMI 2.0.5: FMU states. */

#include "fmi2.h"

#include "../core/state.h"

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *FMUstate) {
    Instance *s = c;
    if (s == NULL || !instance_given(s, "fmi2GetFMUstate", FMUstate)) {
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
    if (s == NULL || !instance_given(s, "fmi2SerializedFMUstateSize", FMUstate)
        || !instance_given(s, "fmi2SerializedFMUstateSize", size)) {
        return fmi2Error;
    }
    return (fmi2Status)state_serialized_size(s, FMUstate, size);
}

fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate FMUstate, fmi2Byte serializedState[], size_t size) {
    Instance *s = c;
    if (s == NULL || !instance_given(s, "fmi2SerializeFMUstate", serializedState)) {
        return fmi2Error;
    }
    return (fmi2Status)state_serialize(s, FMUstate, serializedState, size);
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte serializedState[], size_t size,
                                   fmi2FMUstate *FMUstate) {
    Instance *s = c;
    if (s == NULL || !instance_given(s, "fmi2DeSerializeFMUstate", serializedState)
        || !instance_given(s, "fmi2DeSerializeFMUstate", FMUstate)) {
        return fmi2Error;
    }
    return (fmi2Status)state_deserialize(s, serializedState, size, FMUstate);
}
