/* Numbers with their change along a direction. */

#ifndef DUAL_H
#define DUAL_H

#include <math.h>

#include "../../core/elementary.h"

typedef struct {
    double value, change;
} Dual;

static inline Dual dual(double value, double change) {
    return (Dual){value, change};
}

static inline Dual dual_sum(double x, Dual a, double y, Dual b) {
    return dual(x * a.value + y * b.value, x * a.change + y * b.change);
}

static inline Dual dual_product(Dual a, Dual b) {
    return dual(a.value * b.value, a.value * b.change + a.change * b.value);
}

static inline Dual dual_ratio(Dual a, Dual b) {
    const double value = a.value / b.value;
    return dual(value, (a.change - value * b.change) / b.value);
}

/* The root of a number, 0 of a negative one. */
static inline Dual dual_root(Dual a) {
    const double root = sqrt(a.value > 0.0 ? a.value : 0.0);
    return dual(root, root > 0.0 ? 0.5 * a.change / root : 0.0);
}

static inline Dual dual_larger(Dual a, Dual b) {
    return b.value > a.value ? b : a;
}

#endif
