/* Rounding and remainders without the mathematics library. */

#ifndef ROUNDING_H
#define ROUNDING_H

#include <stdint.h>

/* 2^k for 0 <= k <= 64. */
static inline double power_of_two(int k) {
    return k < 64 ? (double)(UINT64_C(1) << k) : 0x1p64;
}

/* The nearest whole number of 0 <= x, half to even; numbers from 2^52 on have no fraction. */
static inline double nearest(double x) {
    return x < 0x1p52 ? (x + 0x1p52) - 0x1p52 : x;
}

/* The nearest whole number of x, half to even; 0 of what is too large for it, or no number. */
static inline int64_t whole_number(double x) {
    if (!(x > -0x1p62 && x < 0x1p62)) {
        return 0;
    }
    return x < 0.0 ? -(int64_t)nearest(-x) : (int64_t)nearest(x);
}

/* The remainder of x by a positive y, exactly: 0 <= remainder < y, as Python's float % has it. Subtractions of twice and
   twice again y are exact. Of numbers that are not finite it is NaN. */
static inline double remainder_of(double x, double y) {
    double rest = x < 0.0 ? -x : x, part = y;
    if (!(rest < 0x1p1000)) {
        return x - x;
    }
    while (part <= 0.5 * rest) {
        part *= 2.0;
    }
    for (; part >= y; part *= 0.5) {
        rest -= rest >= part ? part : 0.0;
    }
    return x < 0.0 && rest > 0.0 ? y - rest : rest;
}

#endif
