/* The map: its file, and the arrays of it by structures. */

#ifndef MAP_H
#define MAP_H

#include <float.h>
#include <stddef.h>

#include "../../core/resource.h"
#include "../numerics/numerics.h"
#include "map_layout.h"
#include "../../core/atmosphere.h"

/* resources/map.bin: a container of named arrays, whose layout container.c states; strainfmu/estimator/resource/map_file.py writes it.

   map_layout.h lists the arrays. A structure gets its members by MAP_MEMBERS, and its values by MAP_READ, which records
   the first thing that is wrong and does nothing from then on: a module that looks into its values itself checks `good`
   before. Arrays stay in the bytes of the file. */

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

/* The inverse map of an FMU as the linear estimator has it, of the arrays of resources/map.bin: parts "linear", "settings",
   "envelope", "scaled", "scaled_errors". strainfmu/estimator/resource/map_file.py names them, docs/developers/native.md
   describes them. */

#define N_LOADS 5
#define N_FORCES 3 /* of them the first: axial, normal, side; the moments of the last two follow */
#define N_PAIRS 21 /* products c_a c_b, a <= b, of c = [1, the five coefficients] */

/* Half-spaces of the coefficients n'C <= limit, and ranges of the flight state, which may be infinite. */
typedef struct {
    Atmosphere atmosphere; /* p(h), of the layers */
    MAP_MEMBERS(ENVELOPE)
} Envelope;

/* What scales with the pressure ratio, and what does not: docs/explanation/dynamic_pressure.md and
   strainfmu/estimator/reference/linear.py. In form "absolute" the ratio is 1, and all errors are noise. */
typedef struct {
    size_t n_free;              /* free states, which are the first directions, */
    size_t n_fixed;             /* and directions of whose loads none follow the ratio: all in form "absolute" */
    size_t n_columns;           /* columns of spread that are not 0, the first ones */
    int has_errors;             /* whether errors follow the current strain: the members of SCALED_ERRORS are set */
    MAP_MEMBERS(SCALED)
    MAP_MEMBERS(SPREAD) /* NULL where has_low_rank */
    MAP_MEMBERS(SCALED_ERRORS)
} ScaledForm;

/* What follows from the covariance of the gauges, which update/added_noise.c makes. */
typedef struct {
    double *noise_whitening;           /* L^-1 by rows of its lower triangle */
    double *whitening;                 /* (n_gauges, n_gauges) V', a row for each gauge */
    double *singular;                  /* (n_gauges) S */
    double *load;                      /* (n_gauges, n_loads) of each direction, the five and those in addition; in form "absolute"
                                          the gain of each, */
    double *noise_left, *prior_left;   /* (n_gauges, 5) and what noise and prior leave of the loads by it: in that form alone */
    double *unseen;                    /* (5, 5) R */
    double *min_precision;             /* (n_gauges) P_ii that is round-off, by the errors that do not scale */
    double *other_unseen;              /* variances of the same of loads in addition to the five */
} NoiseMatrices;

/* An inverse map for n_gauges gauges and n_states pressure states; arrays point into the file's bytes.
   Triangles are packed as numerics.h describes; each stands for the matrix of which it is the R of a QR
   decomposition: all that is computed from the two is the same. */
typedef struct {
    uint32_t checksum;
    const char *guid;
    MAP_MEMBERS(LINEAR)
    MAP_MEMBERS(GAUGE_COVARIANCE) /* NULL where has_low_rank */
    int has_low_rank; /* whether it has many gauges, whose errors but for their own are the columns of error_strain */
    MAP_MEMBERS(LOW_RANK)
    MAP_MEMBERS(SETTINGS)
    MAP_MEMBERS(ANGLES) /* 0 where not known */
    const NoiseMatrices *made;
    Envelope envelope;
    ScaledForm form;
    int has_tables, has_filter, has_known; /* whether there are tables over the flight state, a filter, and tables over
                                              other parameters of the flow */
} Map;

/* p(h) [Pa]; NaN where h is not known or outside the atmosphere. */
double ambient_pressure(const Envelope *envelope, double altitude);

/* Read a file that map_open has checked; the arrays of what not every map has stay for others. 1; 0 with a text. */
int map_parse(MapFile *file, Map *map);

/* The tables over the flight state, part "flight" of resources/map.bin. strainfmu/estimator/resource/compact_tables.py has
   the formulas. */

#define N_STATES 4     /* of the flight state: M [1], u, w [rad], ln(p_inf / Pa) */
#define N_NAVIGATION 3 /* M [1], p_inf [Pa], q_inf [Pa] */
#define MAX_SHAPES 16  /* discrepancy modes that are tested: the largest length of flight.shapes */
#define N_MEASURED 7   /* M, ln p_inf, ln q_inf of navigation; then the four priors */

enum { STATE_MACH, STATE_U, STATE_W, STATE_PRESSURE };

/* Tables of some rows; arrays point into the bytes of the file. A row is the sum of one term or two. */
typedef struct {
    size_t n_rows;
    MAP_MEMBERS(KNOTS)
    MAP_MEMBERS(TABLES)
} TableMap;

/* Quantities and units: strainfmu/estimator/map/nonlinear_map.py. */
typedef struct {
    TableMap tables;     /* of strains, then loads */
    TableMap considered; /* of strains, then all loads, of a considered error; no rows in maps without */
    int has_gain_error;  /* of any row's own */
    MAP_MEMBERS(FLIGHT)
} FlightMap;

/* The reference of a coefficient: an area, of a moment times a length. */
static inline double map_reference(const FlightMap *map, int is_moment) {
    return map->reference_area * (is_moment ? map->reference_length : 1.0);
}

/* Read tables of n_rows rows of a part, whose knots are known. 1; 0 with a text. */
int tables_parse(MapFile *file, const char *part, size_t n_rows, TableMap *tables);

/* Read the part of the considered error that has tables of strains and loads, after the part of the tables. 1; 0 with a
   text. */
int considered_parse(MapFile *file, size_t n_gauges, size_t n_loads, FlightMap *map);

/* Read the part for n_gauges gauges. 1; 0 with a text that states what is wrong. */
int flight_map_parse(MapFile *file, size_t n_gauges, FlightMap *map);

#endif
