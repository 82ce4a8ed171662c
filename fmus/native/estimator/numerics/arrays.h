/* Blocks of memory that are handed out in pieces. */

#ifndef ARRAYS_H
#define ARRAYS_H

#include <stddef.h>

/* The next `count` doubles of a block, of which *doubles moves on. */
static inline double *taken(double **doubles, size_t count) {
    double *array = *doubles;
    *doubles += count;
    return array;
}

#endif
