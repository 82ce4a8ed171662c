/* The functions of FMI 2.0 that the host calls, from a library that it loads. */

#ifndef LOADED_LIBRARY_H
#define LOADED_LIBRARY_H

#include "fmi2FunctionTypes.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#ifdef _WIN32
#include <windows.h>
#else
#include <dlfcn.h>
#endif

#define FUNCTIONS(DO)                                                                                                  \
    DO(fmi2Instantiate)                                                                                                \
    DO(fmi2FreeInstance)                                                                                               \
    DO(fmi2SetupExperiment)                                                                                            \
    DO(fmi2EnterInitializationMode)                                                                                    \
    DO(fmi2ExitInitializationMode)                                                                                     \
    DO(fmi2DoStep)                                                                                                     \
    DO(fmi2GetReal)                                                                                                    \
    DO(fmi2GetInteger)                                                                                                 \
    DO(fmi2GetBoolean)                                                                                                 \
    DO(fmi2GetDirectionalDerivative)                                                                                   \
    DO(fmi2Reset)                                                                                                      \
    DO(fmi2SetReal)                                                                                                    \
    DO(fmi2SetBoolean)                                                                                                 \
    DO(fmi2GetFMUstate)                                                                                                \
    DO(fmi2SetFMUstate)                                                                                                \
    DO(fmi2FreeFMUstate)                                                                                               \
    DO(fmi2SerializedFMUstateSize)                                                                                     \
    DO(fmi2SerializeFMUstate)                                                                                          \
    DO(fmi2DeSerializeFMUstate)

#define DECLARE(name) static name##TYPE *name;
FUNCTIONS(DECLARE)

static void *opened(const char *path) {
#ifdef _WIN32
    return (void *)LoadLibraryA(path);
#else
    return dlopen(path, RTLD_NOW | RTLD_LOCAL);
#endif
}

/* The address of a function, copied into a pointer to it: C has no conversion between the two kinds of pointer. */
static void find(void *library, const char *name, void *function, size_t size) {
#ifdef _WIN32
    const FARPROC address = GetProcAddress((HMODULE)library, name);
#else
    void *const address = dlsym(library, name);
#endif
    if (address == NULL || sizeof address != size) {
        fprintf(stderr, "host: the library has no %s\n", name);
        exit(1);
    }
    memcpy(function, &address, size);
}

static void load_library(const char *path) {
    void *library = opened(path);
    if (library == NULL) {
        fprintf(stderr, "host: cannot load %s\n", path);
        exit(1);
    }
#define FIND(name) find(library, #name, (void *)&name, sizeof name);
    FUNCTIONS(FIND)
}

#endif
