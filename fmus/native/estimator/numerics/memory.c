/* Blocks of zeros at multiples of MEMORY_ALIGNMENT. A block of the heap is preceded by the address of the block before
   it, so that all are freed by one walk; pieces of a buffer follow one another. Nothing but opening a map takes any. */

#include "numerics.h"

#include <stdint.h>
#include <stdlib.h>
#include <string.h>

static unsigned char *aligned(unsigned char *address) {
    return address + (MEMORY_ALIGNMENT - (uintptr_t)address % MEMORY_ALIGNMENT) % MEMORY_ALIGNMENT;
}

Memory memory_in(void *buffer, size_t size) {
    Memory memory = {NULL, aligned(buffer), 0, 0};
    const size_t skipped = (size_t)(memory.next - (unsigned char *)buffer);
    memory.left = size > skipped ? size - skipped : 0;
    return memory;
}

void *memory_take(Memory *memory, size_t size) {
    const size_t room = (size + MEMORY_ALIGNMENT - 1) / MEMORY_ALIGNMENT * MEMORY_ALIGNMENT;
    unsigned char *block = memory->next;
    if (block != NULL) {
        if (room > memory->left) {
            return NULL;
        }
        memset(block, 0, room);
        memory->next += room;
        memory->left -= room;
    } else {
        unsigned char *link = calloc(1, 2 * MEMORY_ALIGNMENT + room);
        if (link == NULL) {
            return NULL;
        }
        memcpy(link, &memory->last, sizeof memory->last);
        memory->last = link;
        block = aligned(link + sizeof memory->last);
    }
    memory->taken += room;
    return block;
}

int memory_hand_out(Memory *memory, ListPieces *list, void *part) {
    Room room = {NULL, 0};
    list(part, &room);
    room.next = memory_take(memory, room.size);
    if (room.next == NULL) {
        return 0;
    }
    list(part, &room);
    return 1;
}

void memory_free(const Memory *memory) {
    void *block = memory->last;
    while (block != NULL) {
        void *before;
        memcpy(&before, block, sizeof before);
        free(block);
        block = before;
    }
}
