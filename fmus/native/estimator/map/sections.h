/* Sections behind the arrays of resources/map.bin, of what not every map has: a name of 8 bytes, the length of the
   content of 8 bytes, the CRC-32 of that, and four zeros; then the content, a multiple of 8 bytes. */

#ifndef SECTIONS_H
#define SECTIONS_H

#include "../../core/resource.h"

typedef enum {
    FLIGHT_SECTION,
    THERMAL_SECTION,
    FURTHER_SECTION,
    FLIGHT_LOADS_SECTION,
    FILTER_SECTION,
    LINEAR_FILTER_SECTION,
    TARE_SECTION,
    PARAMETER_SECTION,
    SENSOR_SECTION,
    KNOWN_SECTION,
    N_SECTION_KINDS
} SectionKind;

typedef struct {
    const unsigned char *content; /* NULL where the map has no such section */
    size_t length;
} Section;

/* Find the `count` sections that bytes [length] are. 1; 0 with a text that states what is wrong. */
int sections_find(const unsigned char *bytes, size_t length, size_t count, Section found[N_SECTION_KINDS],
                  char text[MODEL_TEXT_SIZE]);

/* The next `count` doubles of a content. */
static inline const double *take_doubles(const double **next, size_t count) {
    const double *array = *next;
    *next += count;
    return array;
}

#endif
