/* The CRC of a protected frame. */

#ifndef FRAME_CRC_H
#define FRAME_CRC_H

#include "strainbus.h"

/* CRC of the `n` bytes of a frame but for its own, up to byte `end` (all below 0), and of `covered`, bytes of other
   frames; strainfmu/can/wire/crc.py states both profiles. */
uint16_t frame_crc(int64_t profile, int64_t data_id, int64_t end, const uint8_t *data, int64_t n,
                   const uint8_t *covered, int64_t n_covered);

#endif
