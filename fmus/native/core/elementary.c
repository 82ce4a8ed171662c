/* Exponential, logarithm, sine, cosine and angle from plain arithmetic and square roots, which IEEE 754 rounds alike
   everywhere: a libm differs in the last bit from platform to platform.

   Each argument is reduced to a small one, then a series of fixed length follows, summed from its smallest term:

       sin, cos   x = q pi/2 + r, |r| <= pi/4         Taylor series to r^19, quadrant by q mod 4
       e^x        x = k ln 2 + r, |r| <= ln 2 / 2     Taylor series to r^14, times 2^k
       ln x       x = 2^k f, sqrt(1/2) <= f < sqrt 2  2 artanh s, s = (f - 1)/(f + 1), series to s^25, plus k ln 2
       atan t     0 <= t <= 1                         tan(x/2) = t / (1 + sqrt(1 + t^2)) twice, series to t^23

   Several exponentials or logarithms at once are the same operations, number by number: their divisions overlap, and
   the bits are equal. docs/developers/native.md, "Conventions". */

#include "elementary.h"

#include <float.h>
#include <math.h>
#include <stdint.h>
#include <string.h>

/* pi/2 and ln 2 in two parts, of which the first has zeros at its end, so that small multiples of it are exact
   (Cody & Waite, Software Manual for the Elementary Functions, 1980). */
static const double HALF_PI_HIGH = 1.5707963267341256, HALF_PI_LOW = 6.0771005065061922e-11;
static const double LN_2_HIGH = 0.69314718036912382, LN_2_LOW = 1.9082149292705877e-10;
static const double HALF_PI = 1.5707963267948966, LN_2 = 0.69314718055994531;

static int32_t nearest(double x) {
    return (int32_t)(x < 0.0 ? x - 0.5 : x + 0.5);
}

void sine_cosine(double angle, double *sine, double *cosine) {
    if (!(angle > -1e5 && angle < 1e5)) {
        *sine = *cosine = NAN;
        return;
    }
    const int32_t quarter = nearest(angle / HALF_PI);
    const double r = (angle - quarter * HALF_PI_HIGH) - quarter * HALF_PI_LOW, square = r * r;
    /* Taylor series on |r| <= pi/4, from the smallest term. */
    double s = 1.0, c = 1.0;
    /* Horner's scheme of both series at once. */
    for (int k = 18; k > 0; k -= 2) {
        s = 1.0 - s * square / (k * (k + 1));
        c = 1.0 - c * square / (k * (k - 1));
    }
    s *= r;
    switch (quarter & 3) {
    case 0: *sine = s, *cosine = c; break;
    case 1: *sine = c, *cosine = -s; break;
    case 2: *sine = -s, *cosine = -c; break;
    default: *sine = -c, *cosine = s; break;
    }
}

/* atan t for 0 <= t <= 1: halved twice, tan(x/2) = t/(1 + sqrt(1 + t^2)), then the series. */
static double arc_tangent(double t) {
    for (int k = 0; k < 2; k++) {
        t /= 1.0 + sqrt(1.0 + t * t);
    }
    double sum = 0.0;
    for (int k = 23; k > 0; k -= 2) {
        sum = 1.0 / k - t * t * sum;
    }
    return 4.0 * t * sum;
}

double angle_of(double y, double x) {
    const double size = x < 0.0 ? -x : x;
    if (y == 0.0 && size == 0.0) {
        return 0.0;
    }
    /* The smaller ratio, so that t <= 1; the other half of the quadrant by pi/2 - x. */
    const double angle = y <= size ? arc_tangent(y / size) : HALF_PI - arc_tangent(size / y);
    return x < 0.0 ? 2.0 * HALF_PI - angle : angle;
}

/* 2 to a power from -1022 to 1023. */
static double power_of_two(int32_t power) {
    const uint64_t bits = (uint64_t)(power + 1023) << 52;
    double value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

#define TOGETHER 8

/* e^x of up to TOGETHER numbers. */
static inline void exponentials_of(size_t count, double *x) {
    double r[TOGETHER], sum[TOGETHER];
    int32_t power[TOGETHER];
    for (size_t i = 0; i < count; i++) {
        const double inside = x[i] > -700.0 && x[i] < 700.0 ? x[i] : 0.0;
        power[i] = nearest(inside / LN_2);
        r[i] = (inside - power[i] * LN_2_HIGH) - power[i] * LN_2_LOW;
        sum[i] = 1.0;
    }
    for (int k = 14; k > 0; k--) {
        for (size_t i = 0; i < count; i++) {
            sum[i] = 1.0 + sum[i] * r[i] / k;
        }
    }
    for (size_t i = 0; i < count; i++) {
        x[i] = x[i] > -700.0 && x[i] < 700.0 ? sum[i] * power_of_two(power[i]) : NAN;
    }
}

/* ln x of up to TOGETHER numbers. */
static inline void logarithms_of(size_t count, double *x) {
    double s[TOGETHER], sum[TOGETHER];
    int32_t power[TOGETHER];
    for (size_t i = 0; i < count; i++) {
        const int is_subnormal = x[i] < DBL_MIN;
        const double scaled = is_subnormal ? x[i] * power_of_two(54) : x[i];
        uint64_t bits;
        memcpy(&bits, &scaled, sizeof bits);
        power[i] = (int32_t)(bits >> 52) - (is_subnormal ? 1022 + 54 : 1022);
        bits = (bits & 0xFFFFFFFFFFFFFu) | (uint64_t)1022 << 52; /* of the fraction: 1/2 <= fraction < 1 */
        double fraction;
        memcpy(&fraction, &bits, sizeof fraction);
        if (fraction < 0.70710678118654752) {
            fraction *= 2.0;
            power[i]--;
        }
        /* ln f = 2 artanh((f - 1)/(f + 1)). */
        s[i] = (fraction - 1.0) / (fraction + 1.0);
        sum[i] = 0.0;
    }
    for (int k = 25; k > 0; k -= 2) {
        for (size_t i = 0; i < count; i++) {
            sum[i] = 1.0 / k + s[i] * s[i] * sum[i];
        }
    }
    for (size_t i = 0; i < count; i++) {
        x[i] = 2.0 * s[i] * sum[i] + power[i] * LN_2_LOW + power[i] * LN_2_HIGH;
    }
}

#define OF_ALL(some)                                              \
    for (; count >= TOGETHER; count -= TOGETHER, x += TOGETHER) { \
        some(TOGETHER, x);                                        \
    }                                                             \
    for (; count > 0; count--, x++) {                             \
        some(1, x);                                               \
    }

void exponentials(size_t count, double *x) {
    OF_ALL(exponentials_of)
}

void logarithms(size_t count, double *x) {
    OF_ALL(logarithms_of)
}

double exponential(double x) {
    exponentials_of(1, &x);
    return x;
}

double logarithm(double x) {
    logarithms_of(1, &x);
    return x;
}
