/* One source, two instruction sets: on x86-64 the products of every step are compiled for SSE2 and for AVX2. */

#ifndef WIDE_H
#define WIDE_H

#if defined(__x86_64__) && defined(__GNUC__)
#define HAS_AVX2 1
#define AVX2 __attribute__((target("avx2")))
#define EVERYWHERE static inline __attribute__((always_inline))
/* The function of that name, or the one for AVX2. */
#define CHOSEN(wide, name) ((wide) ? name##_avx2 : (name))
#else
#define HAS_AVX2 0
#define EVERYWHERE static inline
#define CHOSEN(wide, name) ((void)(wide), (name))
#endif

#endif
