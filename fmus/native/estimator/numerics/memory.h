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

/* A block in pieces: one list of them, gone through twice, counts what they take and hands them out. */
typedef struct {
    unsigned char *next; /* NULL while pieces are counted alone: they are NULL then */
    size_t size;         /* bytes of all pieces so far */
} Room;

/* The next piece, of `count` elements of a size; in multiples of 8 bytes, so that any type follows. */
static inline void *piece(Room *room, size_t count, size_t size) {
    const size_t bytes = (count * size + 7) / 8 * 8;
    void *start = room->next;
    room->size += bytes;
    if (room->next != NULL) {
        room->next += bytes;
    }
    return start;
}

static inline double *taken(Room *room, size_t count) {
    return piece(room, count, sizeof(double));
}

/* The next pieces, of `count` doubles each. */
#define TAKE(room, count, ...) take_each(room, count, (double **[]){__VA_ARGS__, NULL})
static inline void take_each(Room *room, size_t count, double **const array[]) {
    for (; *array != NULL; array++) {
        **array = taken(room, count);
    }
}

/* Give a part of an estimator a block for all its pieces, by the function that lists them; what lies in it is filled in where
   room->next is not NULL. 1; 0 where there is no memory. */
typedef void ListPieces(void *part, Room *room);
int memory_hand_out(Memory *memory, ListPieces *list, void *part);

#endif
