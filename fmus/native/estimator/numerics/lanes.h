/* Sums in lanes: LANES parts, which are added in one order on every processor. */

#ifndef LANES_H
#define LANES_H

#include <stddef.h>

#define LANES 4

/* The smallest multiple of LANES that holds n. */
static inline size_t in_lanes(size_t n) {
    return (n + LANES - 1) / LANES * LANES;
}

#endif
