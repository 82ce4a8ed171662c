/* resources/map.bin: a container of named arrays, whose layout container.c states; strainfmu/estimator/resource/map_file.py writes it.

   map_layout.h lists the arrays. A structure gets its members by MAP_MEMBERS, and its values by MAP_READ, which records
   the first thing that is wrong and does nothing from then on: a module that looks into its values itself checks `good`
   before. Arrays stay in the bytes of the file. */

#ifndef CONTAINER_H
#define CONTAINER_H

#include <float.h>
#include <stddef.h>

#include "../../core/resource.h"
#include "../numerics/memory.h"
#include "map_layout.h"

#define MAP_FORMAT_VERSION 8
#define MOST_ARRAYS 512

typedef struct {
    const unsigned char *bytes;
    size_t count;                          /* arrays */
    unsigned char is_taken[MOST_ARRAYS];   /* whether an array has been read */
    size_t length[N_SYMBOLS];               /* of each symbol, once it is bound */
    int good;
    char *text;     /* (MODEL_TEXT_SIZE) what is wrong */
    Memory *memory; /* of the estimator, for the parts that are read */
} MapFile;

/* Check bytes [length], which must be aligned as double and outlive what is taken of them: checksum, table, positions;
   that all numbers are finite. 1; 0 with a text. */
int map_open(MapFile *file, const unsigned char *bytes, size_t length, char text[MODEL_TEXT_SIZE]);

/* Memory for a part of the estimator, as of memory_hand_out. 1; 0, after a message, where there is no more. */
int map_hand_out(MapFile *file, ListPieces *list, void *part);

/* Whether there are arrays PART.anything. */
int map_has(const MapFile *file, const char *part);

/* Kinds of members, and what the values of an array must be besides finite. */
enum { MAP_NUMBER, MAP_WHOLE, MAP_COUNT, MAP_LENGTH, MAP_TEXT, MAP_ARRAY, MAP_VALUES };
enum { MAP_VALUES_2 = MAP_VALUES, MAP_VALUES_3 = MAP_VALUES, MAP_VALUES_4 = MAP_VALUES };
enum { MAP_ANY, MAP_POSITIVE, MAP_BETWEEN, MAP_COVARIANCE, MAP_FROM_0, MAP_INCREASING, MAP_RANGE, MAP_BOUNDS };

/* A length: times that of a symbol, plus a number. */
typedef struct {
    int symbol, times, plus;
} MapLength;

/* An array of a part. A length is of axis `rank`, from length[0] to length[1]; a whole number reaches to `high`, or to
   length[0] where that is 0. */
typedef struct {
    const char *name;
    size_t member; /* its place in the structure */
    int kind, rule;
    size_t rank;
    double low, high;
    int symbol; /* that a length binds */
    MapLength length[4];
} MapRow;

/* What map_layout.h is made of: members of a structure, rows of a table. */
#define AXIS(symbol, times, plus) {SYM_##symbol, times, plus}
#define FIXED(count) {SYM_NONE, 0, count}
#define MAP_MEMBER_NUMBER(name) double name;
#define MAP_MEMBER_WHOLE(name) int name;
#define MAP_MEMBER_COUNT(name) size_t name;
#define MAP_MEMBER_LENGTH(name) size_t name;
#define MAP_MEMBER_TEXT(name) const char *name;
#define MAP_MEMBER_ARRAY(name) const double *name;
#define MAP_MEMBER_VALUES_2(name) double name[2];
#define MAP_MEMBER_VALUES_3(name) double name[3];
#define MAP_MEMBER_VALUES_4(name) double name[4];
#define MAP_MEMBER(T, kind, member, ...) MAP_MEMBER_##kind(member)
#define MAP_ROW(T, kind, member, name, rule, rank, low, high, symbol, ...) \
    {#name, offsetof(T, member), MAP_##kind, MAP_##rule, rank, low, high, symbol, {__VA_ARGS__}},
#define MAP_MEMBERS(GROUP) GROUP(MAP_MEMBER, 0)

/* Read a group of the arrays of a part into a structure of type T. 1; 0 with a text. */
#define MAP_READ(file, part, GROUP, T, into)                                \
    do {                                                                    \
        static const MapRow rows_[] = {GROUP(MAP_ROW, T)};                  \
        map_read(file, part, rows_, sizeof rows_ / sizeof *rows_, into);    \
    } while (0)
int map_read(MapFile *file, const char *part, const MapRow *row, size_t count, void *into);

/* Text of an array that has one of `width` bytes at most. */
const char *map_text(MapFile *file, const char *name, size_t width);

/* Record that a number is not from low to high; that an array is not what is expected, unless a condition holds. They
   return `good`. */
int map_require_between(MapFile *file, const char *name, double value, double low, double high);
int map_require(MapFile *file, int condition, const char *name, const char *expected);

/* Whether all is well and every array has been read: one that nothing reads has a wrong name. */
int map_close(MapFile *file);

#endif
