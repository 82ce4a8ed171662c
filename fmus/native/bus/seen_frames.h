/* A Bloom filter of frames that keeps the two bits of a frame in one word. */

#ifndef SEEN_FRAMES_H
#define SEEN_FRAMES_H

#include "strainbus.h"

#define SEEN_PREFIX 4

/* Remember `count` bytes of data behind the SEEN_PREFIX bytes of a prefix, NULL for none; 1 if they are new. */
int64_t seen_add(uint64_t *words, const uint8_t *prefix, const uint8_t *data, int64_t count);

/* Remember the frames of a cycle, each for itself or all together as one; 1 if they are new. */
int64_t seen_add_frames(uint64_t *words, const SbAssembler *assembler, const SbParts *parts, int together);

#endif
