/* Functions of FMI 3.0 for what no FMU of this project has: other types, structural parameters, partitions.

   Importers need all functions to be there; a list of no variables is no error. */

#include "fmi3.h"

static fmi3Status no_variables(Instance *instance, const char *function, const fmi3ValueReference references[],
                               size_t nReferences) {
    if (instance == NULL || (nReferences > 0 && !instance_given(instance, function, references))) {
        return fmi3Error;
    }
    return nReferences == 0 ? fmi3OK : fmi3_wrong_type(instance, function, references[0]);
}

static fmi3Status not_offered(const Instance *instance, const char *function) {
    return (fmi3Status)instance_not_offered(instance, function);
}

#define GET(Type)                                                                               \
    fmi3Status fmi3Get##Type(fmi3Instance instance, const fmi3ValueReference valueReferences[], \
                             size_t nValueReferences, fmi3##Type values[], size_t nValues) {    \
        (void)values;                                                                           \
        (void)nValues;                                                                          \
        return no_variables(instance, "fmi3Get" #Type, valueReferences, nValueReferences);      \
    }

#define SET(Type)                                                                                  \
    fmi3Status fmi3Set##Type(fmi3Instance instance, const fmi3ValueReference valueReferences[],    \
                             size_t nValueReferences, const fmi3##Type values[], size_t nValues) { \
        (void)values;                                                                              \
        (void)nValues;                                                                             \
        return no_variables(instance, "fmi3Set" #Type, valueReferences, nValueReferences);         \
    }

GET(Float32)
GET(Int8)
GET(UInt8)
GET(Int16)
GET(UInt16)
GET(UInt32)
GET(String)
SET(Float32)
SET(Int8)
SET(UInt8)
SET(Int16)
SET(UInt16)
SET(UInt32)
SET(UInt64)
SET(String)

fmi3Status fmi3GetIntervalFraction(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                                   size_t nValueReferences, fmi3UInt64 counters[], fmi3UInt64 resolutions[],
                                   fmi3IntervalQualifier qualifiers[]) {
    (void)counters;
    (void)resolutions;
    (void)qualifiers;
    return no_variables(instance, "fmi3GetIntervalFraction", valueReferences, nValueReferences);
}

fmi3Status fmi3GetShiftDecimal(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                               size_t nValueReferences, fmi3Float64 shifts[]) {
    (void)shifts;
    return no_variables(instance, "fmi3GetShiftDecimal", valueReferences, nValueReferences);
}

fmi3Status fmi3GetShiftFraction(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                                size_t nValueReferences, fmi3UInt64 counters[], fmi3UInt64 resolutions[]) {
    (void)counters;
    (void)resolutions;
    return no_variables(instance, "fmi3GetShiftFraction", valueReferences, nValueReferences);
}

fmi3Status fmi3SetIntervalDecimal(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                                  size_t nValueReferences, const fmi3Float64 intervals[]) {
    (void)intervals;
    return no_variables(instance, "fmi3SetIntervalDecimal", valueReferences, nValueReferences);
}

fmi3Status fmi3SetIntervalFraction(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                                   size_t nValueReferences, const fmi3UInt64 counters[],
                                   const fmi3UInt64 resolutions[]) {
    (void)counters;
    (void)resolutions;
    return no_variables(instance, "fmi3SetIntervalFraction", valueReferences, nValueReferences);
}

fmi3Status fmi3SetShiftDecimal(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                               size_t nValueReferences, const fmi3Float64 shifts[]) {
    (void)shifts;
    return no_variables(instance, "fmi3SetShiftDecimal", valueReferences, nValueReferences);
}

fmi3Status fmi3SetShiftFraction(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                                size_t nValueReferences, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[]) {
    (void)counters;
    (void)resolutions;
    return no_variables(instance, "fmi3SetShiftFraction", valueReferences, nValueReferences);
}

fmi3Status fmi3GetOutputDerivatives(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                                    size_t nValueReferences, const fmi3Int32 orders[], fmi3Float64 values[],
                                    size_t nValues) {
    (void)valueReferences;
    (void)orders;
    (void)values;
    (void)nValues;
    return nValueReferences == 0 && instance != NULL ? fmi3OK : not_offered(instance, "fmi3GetOutputDerivatives");
}

fmi3Status fmi3GetNumberOfVariableDependencies(fmi3Instance instance, fmi3ValueReference valueReference,
                                               size_t *nDependencies) {
    (void)valueReference;
    (void)nDependencies;
    return not_offered(instance, "fmi3GetNumberOfVariableDependencies");
}

fmi3Status fmi3GetVariableDependencies(fmi3Instance instance, fmi3ValueReference dependent,
                                       size_t elementIndicesOfDependent[], fmi3ValueReference independents[],
                                       size_t elementIndicesOfIndependents[], fmi3DependencyKind dependencyKinds[],
                                       size_t nDependencies) {
    (void)dependent;
    (void)elementIndicesOfDependent;
    (void)independents;
    (void)elementIndicesOfIndependents;
    (void)dependencyKinds;
    (void)nDependencies;
    return not_offered(instance, "fmi3GetVariableDependencies");
}

fmi3Status fmi3ActivateModelPartition(fmi3Instance instance, fmi3ValueReference clockReference,
                                      fmi3Float64 activationTime) {
    (void)clockReference;
    (void)activationTime;
    return not_offered(instance, "fmi3ActivateModelPartition");
}

fmi3Instance fmi3InstantiateScheduledExecution(fmi3String instanceName, fmi3String instantiationToken,
                                               fmi3String resourcePath, fmi3Boolean visible, fmi3Boolean loggingOn,
                                               fmi3InstanceEnvironment instanceEnvironment,
                                               fmi3LogMessageCallback logMessage,
                                               fmi3ClockUpdateCallback clockUpdate,
                                               fmi3LockPreemptionCallback lockPreemption,
                                               fmi3UnlockPreemptionCallback unlockPreemption) {
    (void)instanceName;
    (void)instantiationToken;
    (void)resourcePath;
    (void)visible;
    (void)loggingOn;
    (void)clockUpdate;
    (void)lockPreemption;
    (void)unlockPreemption;
    if (logMessage != NULL) {
        logMessage(instanceEnvironment, fmi3Error, CATEGORY_ERROR,
                   "scheduled execution is not supported by this FMU");
    }
    return NULL;
}
