/* A host that is not Python: loads the FMU LIBRARY, runs ten steps and ends; a fourth argument unloads it before.

     foreign_host LIBRARY GUID RESOURCES [unload] */

#include <dlfcn.h>
#include <stdio.h>
#include <stdlib.h>

#include "fmi2FunctionTypes.h"

static void *library;

static void *function(const char *name) {
    void *found = dlsym(library, name);
    if (found == NULL) {
        fprintf(stderr, "%s\n", dlerror());
        exit(2);
    }
    return found;
}

static void silent(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status, fmi2String category,
                   fmi2String message, ...) {
    (void)environment, (void)name, (void)status, (void)category, (void)message;
}

int main(int n_arguments, char **arguments) {
    library = n_arguments > 3 ? dlopen(arguments[1], RTLD_NOW) : NULL;
    if (library == NULL) {
        fprintf(stderr, "%s\n", n_arguments > 3 ? dlerror() : "three arguments expected");
        return 2;
    }
    const fmi2CallbackFunctions callbacks = {silent, calloc, free, NULL, NULL};
    fmi2Component c = ((fmi2InstantiateTYPE *)function("fmi2Instantiate"))("host", fmi2CoSimulation, arguments[2],
                                                                           arguments[3], &callbacks, 0, 0);
    if (c == NULL) {
        return 3;
    }
    int status = ((fmi2SetupExperimentTYPE *)function("fmi2SetupExperiment"))(c, 0, 0.0, 0.0, 0, 0.0);
    status |= ((fmi2EnterInitializationModeTYPE *)function("fmi2EnterInitializationMode"))(c);
    status |= ((fmi2ExitInitializationModeTYPE *)function("fmi2ExitInitializationMode"))(c);
    for (int k = 0; k < 10; k++) {
        status |= ((fmi2DoStepTYPE *)function("fmi2DoStep"))(c, 0.01 * k, 0.01, 1);
    }
    status |= ((fmi2TerminateTYPE *)function("fmi2Terminate"))(c);
    ((fmi2FreeInstanceTYPE *)function("fmi2FreeInstance"))(c);
    if (n_arguments > 4) {
        dlclose(library);
    }
    printf("done\n");
    return status;
}
