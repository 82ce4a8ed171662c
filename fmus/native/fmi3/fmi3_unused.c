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

/* Parameters of the standard that no function here needs. */
static void unused(int number, ...) {
    (void)number;
}

/* A function of variables, with its other parameters and their names. */
#define NO_VARIABLES(function, parameters, ...)                                      \
    fmi3Status function parameters {                                                 \
        unused(0, __VA_ARGS__);                                                      \
        return no_variables(instance, #function, valueReferences, nValueReferences); \
    }

#define GET(Type) NO_VARIABLES(fmi3Get##Type, (VARIABLES, fmi3##Type values[], size_t nValues), values, nValues)
#define SET(Type) NO_VARIABLES(fmi3Set##Type, (VARIABLES, const fmi3##Type values[], size_t nValues), values, nValues)

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
NO_VARIABLES(fmi3GetIntervalFraction,
             (VARIABLES, fmi3UInt64 counters[], fmi3UInt64 resolutions[], fmi3IntervalQualifier qualifiers[]),
             counters, resolutions, qualifiers)
NO_VARIABLES(fmi3GetShiftDecimal, (VARIABLES, fmi3Float64 shifts[]), shifts)
NO_VARIABLES(fmi3GetShiftFraction, (VARIABLES, fmi3UInt64 counters[], fmi3UInt64 resolutions[]), counters, resolutions)
NO_VARIABLES(fmi3SetIntervalDecimal, (VARIABLES, const fmi3Float64 intervals[]), intervals)
NO_VARIABLES(fmi3SetIntervalFraction, (VARIABLES, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[]), counters,
             resolutions)
NO_VARIABLES(fmi3SetShiftDecimal, (VARIABLES, const fmi3Float64 shifts[]), shifts)
NO_VARIABLES(fmi3SetShiftFraction, (VARIABLES, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[]), counters,
             resolutions)

fmi3Status fmi3GetOutputDerivatives(VARIABLES, const fmi3Int32 orders[], fmi3Float64 values[], size_t nValues) {
    unused(0, valueReferences, orders, values, nValues);
    return nValueReferences == 0 && instance != NULL ? fmi3OK : (fmi3Status)instance_not_offered(instance, "fmi3GetOutputDerivatives");
}

/* A function that is not offered, alike. */
#define NOT_OFFERED(function, parameters, ...)                        \
    fmi3Status function parameters {                                  \
        unused(0, __VA_ARGS__);                                       \
        return (fmi3Status)instance_not_offered(instance, #function); \
    }

NOT_OFFERED(fmi3GetNumberOfVariableDependencies,
            (fmi3Instance instance, fmi3ValueReference valueReference, size_t *nDependencies), valueReference, nDependencies)
NOT_OFFERED(fmi3GetVariableDependencies,
            (fmi3Instance instance, fmi3ValueReference dependent, size_t elementIndicesOfDependent[],
             fmi3ValueReference independents[], size_t elementIndicesOfIndependents[], fmi3DependencyKind dependencyKinds[],
             size_t nDependencies),
            dependent, elementIndicesOfDependent, independents, elementIndicesOfIndependents, dependencyKinds, nDependencies)
NOT_OFFERED(fmi3ActivateModelPartition,
            (fmi3Instance instance, fmi3ValueReference clockReference, fmi3Float64 activationTime), clockReference,
            activationTime)

fmi3Instance fmi3InstantiateScheduledExecution(fmi3String instanceName, fmi3String instantiationToken,
                                               fmi3String resourcePath, fmi3Boolean visible, fmi3Boolean loggingOn,
                                               fmi3InstanceEnvironment instanceEnvironment,
                                               fmi3LogMessageCallback logMessage,
                                               fmi3ClockUpdateCallback clockUpdate,
                                               fmi3LockPreemptionCallback lockPreemption,
                                               fmi3UnlockPreemptionCallback unlockPreemption) {
    unused(0, instanceName, instantiationToken, resourcePath, visible, loggingOn, clockUpdate, lockPreemption,
           unlockPreemption);
    if (logMessage != NULL) {
        logMessage(instanceEnvironment, fmi3Error, CATEGORY_ERROR,
                   "scheduled execution is not supported by this FMU");
    }
    return NULL;
}
