/* The floating-point environment of the processor while a model computes.

   A host may trap floating-point exceptions, round otherwise, or flush subnormal numbers to zero. A model computes with
   what is not a number, and lets products overflow where health then reports it: it takes the default environment of
   IEEE 754 (no traps, round to nearest, subnormal numbers), in which all platforms compute the same bits, and gives the
   host's back, with the exceptions that the host has seen and no others. */

#ifndef FLOATING_H
#define FLOATING_H

#include <stdint.h>

#if defined(__SSE2__) || defined(_M_X64) || (defined(__aarch64__) && defined(__GNUC__))
typedef struct {
    uint64_t control, status;
} Floating;
#else
#include <fenv.h>
typedef fenv_t Floating;
#endif

/* Take the default environment; the result is the host's, for floating_leave. */
Floating floating_enter(void);
void floating_leave(const Floating *host);

#endif
