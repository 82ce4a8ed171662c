/* Which instruction sets the processor and the operating system have: 0 for SSE2 or none of x86, 1 for AVX2, 2 for
   AVX-512.

   The answer chooses between compiled variants of the same sums (wide.h): no result depends on it.
   docs/developers/native.md, "Cost". */

#include "wide.h"

#if HAS_AVX2
#include <cpuid.h>

/* Intel, Software Developer's Manual, volume 1, sections 14.7 and 15.2: AVX2, and an operating system that saves ymm;
   AVX-512, and one that saves zmm. Processors with VBMI2 do not slow down for the latter. */
int wide_of_processor(void) {
    const unsigned needed = bit_AVX512F | bit_AVX512DQ | bit_AVX512BW | bit_AVX512VL;
    unsigned a, b, c, d, saved, high;
    if (!__get_cpuid(1, &a, &b, &c, &d) || !(c & bit_OSXSAVE) || !(c & bit_AVX)) {
        return 0;
    }
    __asm__("xgetbv" : "=a"(saved), "=d"(high) : "c"(0));
    if ((saved & 0x6u) != 0x6u || !__get_cpuid_count(7, 0, &a, &b, &c, &d) || !(b & bit_AVX2)) {
        return 0;
    }
    return (saved & 0xe6u) == 0xe6u && (b & needed) == needed && (c & bit_AVX512VBMI2) ? 2 : 1;
}
#else
int wide_of_processor(void) {
    return 0;
}
#endif
