/* A matrix by rows, by columns, or a part of either: the left factor of products.h and blocks.h. */

#ifndef STRIDED_H
#define STRIDED_H

#include <stddef.h>

/* A matrix whose element (i, k) is value[i * row + k * column]. */
typedef struct {
    const double *value;
    size_t row, column;
} Strided;

/* One whose rows are `row` apart. */
static inline Strided by_rows(const double *value, size_t row) {
    return (Strided){value, row, 1};
}

#endif
