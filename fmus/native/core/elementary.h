/* Elementary functions that give the same bits on every platform: plain arithmetic and square roots, no libm. */

#ifndef ELEMENTARY_H
#define ELEMENTARY_H

#include <stddef.h>

/* Sine and cosine of an angle [rad] below 1e5 in size; NaN beyond. */
void sine_cosine(double angle, double *sine, double *cosine);

/* Angle of the point (x, y) from the positive x axis, for y >= 0: 0 to pi. */
double angle_of(double y, double x);

/* e^x for |x| < 700; NaN beyond. */
double exponential(double x);

/* Natural logarithm of a positive, finite x. */
double logarithm(double x);

/* The same of several numbers, in place and bit for bit, in less time: their divisions do not wait for each other. */
void exponentials(size_t count, double *x);
void logarithms(size_t count, double *x);

#endif
