/* The map: the bytes of resources/map.bin of an FMU, for sl_open. */

#ifndef MAP_DATA_H
#define MAP_DATA_H

#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

extern const unsigned char sl_map_data[];
extern const size_t sl_map_size; /* [bytes] */

#ifdef __cplusplus
}
#endif

#endif
