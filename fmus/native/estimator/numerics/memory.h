/* Memory of an estimator: blocks of the heap, or pieces of a buffer of the caller. A block holds zeros, and starts at a
   multiple of 64 bytes, as vector loads like it. Blocks are freed together. */

#ifndef MEMORY_H
#define MEMORY_H

#include <stddef.h>

#define MEMORY_ALIGNMENT 64

typedef struct {
    void *last;          /* block of the heap, which begins with a pointer to the one before it */
    unsigned char *next; /* of a buffer; NULL for the heap */
    size_t left;         /* bytes of it */
    size_t taken;        /* bytes of all blocks */
} Memory;

/* Memory in a buffer of `size` bytes. */
Memory memory_in(void *buffer, size_t size);

/* A block of `size` bytes; NULL where there is no more. */
void *memory_take(Memory *memory, size_t size);

/* Free all blocks; a buffer stays the caller's. */
void memory_free(const Memory *memory);

#endif
