/* resources/map.bin: a container of named arrays.

   Little endian. The first 32 bytes are as in resource.h, with the checksum of all that follows; then the number of
   arrays, of 4 bytes, and 12 zeros; then an entry for each array, by ascending names: name (48 bytes, ended by zeros),
   kind, rank, four lengths (4 bytes each, 0 beyond the rank), position in the file (8 bytes). The arrays follow one
   another in the order of the entries, row by row, each from a multiple of 16 bytes on.
   strainfmu/estimator/resource/container.py writes it.

   A module fills its structure by the functions below, one line a value. They record the first thing that is wrong, and
   return 0 or NULL from then on: a module that looks into its values itself checks `good` before. */

#ifndef CONTAINER_H
#define CONTAINER_H

#include "../../core/resource.h"

#define MAP_FORMAT_VERSION 8
#define MOST_ARRAYS 512

typedef struct {
    const unsigned char *bytes;
    size_t count;                          /* arrays */
    unsigned char is_taken[MOST_ARRAYS];   /* whether an array has been read */
    int good;
    char *text; /* (MODEL_TEXT_SIZE) what is wrong */
} MapFile;

/* Check bytes [length], which must be aligned as double and outlive what is taken of them: checksum, table, positions;
   that all numbers are finite. 1; 0 with a text. */
int map_open(MapFile *file, const unsigned char *bytes, size_t length, char text[MODEL_TEXT_SIZE]);

/* Whether there are arrays PART.anything. */
int map_has(const MapFile *file, const char *part);

/* Length of an array along an axis, from `least` to `most`; the accessors check the other lengths. */
size_t map_length(MapFile *file, const char *name, size_t axis, size_t least, size_t most);

/* Numbers: any, above zero, from low to high; a whole one. */
double map_number(MapFile *file, const char *name);
double map_positive(MapFile *file, const char *name);
double map_between(MapFile *file, const char *name, double low, double high);
size_t map_count(MapFile *file, const char *name, size_t least, size_t most);

/* Arrays of the shape that follows the name: any numbers, numbers above zero. */
#define map_doubles(file, name, ...) map_doubles_of(file, name, MAP_SHAPE(__VA_ARGS__))
#define map_positives(file, name, ...) map_positives_of(file, name, MAP_SHAPE(__VA_ARGS__))
#define MAP_SHAPE(...) (const size_t[]){__VA_ARGS__}, sizeof((const size_t[]){__VA_ARGS__}) / sizeof(size_t)
const double *map_doubles_of(MapFile *file, const char *name, const size_t *shape, size_t rank);
const double *map_positives_of(MapFile *file, const char *name, const size_t *shape, size_t rank);

/* A covariance (n, n): numbers, on the diagonal above zero. */
const double *map_covariance(MapFile *file, const char *name, size_t n);

/* `count` numbers, copied. */
void map_copy(MapFile *file, const char *name, size_t count, double *values);

/* `rows` texts of `width` bytes, each ended by a zero. */
const char *map_texts(MapFile *file, const char *name, size_t rows, size_t width);

/* Record that an array is not what is expected, unless a condition holds; that memory is short. They return `good`. */
int map_require(MapFile *file, int condition, const char *name, const char *expected);
int map_no_memory(MapFile *file);

/* Whether all is well and every array has been read: one that nothing reads has a wrong name. */
int map_close(MapFile *file);

#endif
