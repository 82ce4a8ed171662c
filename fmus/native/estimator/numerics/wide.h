/* One source, several instruction sets: on x86-64 the products of every step are compiled for SSE2 and for AVX2, products of
   matrices for AVX-512 too. Which one runs changes no bit. */

#ifndef WIDE_H
#define WIDE_H

#include <stddef.h>

#if defined(__x86_64__) && defined(__GNUC__)
#define HAS_AVX2 1
#define AVX2 __attribute__((target("avx2")))
#define EVERYWHERE static inline __attribute__((always_inline))
#define AVX512 __attribute__((target("avx512f,avx512dq,avx512bw,avx512vl")))
/* The function of that name, or the one for AVX2, or for the most that there is; the one for AVX2 of a function of EVERYWHERE
   that returns a type, or nothing. */
#define CHOSEN(wide, name) ((wide) ? name##_avx2 : (name))
#define WIDEST(wide, name) ((wide) > 1 ? name##_avx512 : (wide) ? name##_avx2 : (name))
#define FOR_AVX2_AS(type, name, parameters, arguments) \
    AVX2 static type name##_avx2 parameters { \
        return name arguments; \
    }
#define FOR_AVX2(name, parameters, arguments) \
    AVX2 static void name##_avx2 parameters { \
        name arguments; \
    }
#else
#define HAS_AVX2 0
#define EVERYWHERE static inline
#define CHOSEN(wide, name) ((void)(wide), (name))
#define WIDEST(wide, name) CHOSEN(wide, name)
#define FOR_AVX2_AS(type, name, parameters, arguments)
#define FOR_AVX2(name, parameters, arguments)
#endif

#define LANES 4

/* The smallest multiple of LANES that holds n. */
static inline size_t in_lanes(size_t n) {
    return (n + LANES - 1) / LANES * LANES;
}

#endif
