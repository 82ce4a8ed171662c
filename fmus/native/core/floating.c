/* The floating-point environment while a model computes: default of IEEE 754, and the host's afterwards.

   On x86-64 it is MXCSR, on ARM FPCR and FPSR; elsewhere the functions of fenv.h. Exceptions that a model raises are
   not reported to the host, the ones that the host has raised before stay. docs/developers/native.md, "Conventions". */

#include "floating.h"

#if defined(__SSE2__) || defined(_M_X64)

#include <xmmintrin.h>

#define DEFAULT_CONTROL 0x1F80u /* of MXCSR: all exceptions masked, none seen; nearest, subnormal numbers */
#define SEEN 0x3Fu               /* its bits of exceptions seen */

/* A processor takes long to change MXCSR, which most hosts leave at its default: it is set where it differs. */
Floating floating_enter(void) {
    const Floating host = {_mm_getcsr(), 0};
    if ((host.control & ~SEEN) != DEFAULT_CONTROL) {
        _mm_setcsr(DEFAULT_CONTROL);
    }
    return host;
}

void floating_leave(const Floating *host) {
    if (_mm_getcsr() != host->control) {
        _mm_setcsr((unsigned)host->control);
    }
}

#elif defined(__aarch64__) && defined(__GNUC__)

static void set(uint64_t control, uint64_t status) {
    __asm__ volatile("msr fpcr, %0\n\tmsr fpsr, %1" : : "r"(control), "r"(status) : "memory");
}

Floating floating_enter(void) {
    Floating host;
    __asm__ volatile("mrs %0, fpcr\n\tmrs %1, fpsr" : "=r"(host.control), "=r"(host.status) : : "memory");
    set(0, host.status);
    return host;
}

void floating_leave(const Floating *host) {
    set(host->control, host->status);
}

#else

Floating floating_enter(void) {
    Floating host;
    feholdexcept(&host);
    fesetround(FE_TONEAREST);
    return host;
}

void floating_leave(const Floating *host) {
    fesetenv(host);
}

#endif
