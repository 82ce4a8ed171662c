/* Reading map.bin: a container of named arrays, checked as a whole before anything of it is used.

   Layout: 32 bytes of header with checksum (core/resource.h), the number of arrays at COUNT_AT, a table of
   ENTRY_SIZE bytes for each array from TABLE_AT on, by ascending names, then the arrays in the same order, each from
   a multiple of ALIGNMENT on:

       entry = name (48 bytes) | kind | rank | 4 lengths (4 bytes each) | position (8 bytes)

   A file may come from anywhere. map_open checks the table entry by entry: a name of allowed letters that is greater
   than the last one, a kind and a rank that exist, lengths whose product does not overflow, the position where the
   last array ended, no bytes left at the end, finite numbers. So later functions may trust offsets. map_read then
   checks name, kind, shape and values against the rows of map_layout.h and notes the first fault; map_close refuses
   arrays that nobody has read, which have a wrong name. docs/developers/native.md, "The map file";
   strainfmu/estimator/resource/map_file.py writes it. */

#include "map.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>

#define COUNT_AT 32
#define TABLE_AT 48
#define NAME_SIZE 48
#define MOST_AXES 4
#define ENTRY_SIZE 80
#define ALIGNMENT 16

enum { DOUBLES, INTEGERS, TEXTS, N_KINDS };
enum { KIND_AT = NAME_SIZE, RANK_AT = 52, SHAPE_AT = 56, POSITION_AT = 72 }; /* in an entry */

static const char MAGIC[8] = "SFMUMAP";
static const size_t SIZE_OF[N_KINDS] = {8, 4, 1};

static int refuse(MapFile *file, const char *format, ...) {
    if (file->good) {
        va_list arguments;
        va_start(arguments, format);
        vsnprintf(file->text, MODEL_TEXT_SIZE, format, arguments);
        va_end(arguments);
    }
    file->good = 0;
    return 0;
}

static const unsigned char *entry_of(const MapFile *file, size_t k) {
    return file->bytes + TABLE_AT + k * ENTRY_SIZE;
}

static const char *name_of(const MapFile *file, size_t k) {
    return (const char *)entry_of(file, k);
}

static size_t length_along(const unsigned char *entry, size_t axis) {
    return u32_at(entry, SHAPE_AT + 4 * axis);
}

static const unsigned char *content_of(const MapFile *file, const unsigned char *entry) {
    uint64_t position;
    memcpy(&position, entry + POSITION_AT, sizeof position);
    return file->bytes + position;
}

/* Whether a name can be: letters, figures, and behind the one before it. */
static int check_name(MapFile *file, size_t k) {
    static const char SIGNS[] = "abcdefghijklmnopqrstuvwxyz0123456789_.";
    const char *name = name_of(file, k);
    const char *end = memchr(name, '\0', NAME_SIZE);
    if (end == NULL || end == name || strspn(name, SIGNS) != (size_t)(end - name)) {
        return refuse(file, "holds a name that cannot be (array %lu)", (unsigned long)k);
    }
    if (k > 0 && strcmp(name_of(file, k - 1), name) >= 0) {
        return refuse(file, "'%s': stands twice or out of order", name);
    }
    return 1;
}

static int check_finite(MapFile *file, const char *name, const double *value, size_t count) {
    for (size_t i = 0; i < count; i++) {
        if (!isfinite(value[i])) {
            return refuse(file, "'%s': holds a value that is not finite (number %lu)", name, (unsigned long)i);
        }
    }
    return 1;
}

/* Check an entry whose array has to begin at *next, and move that to its end. Lengths are divided, never multiplied
   beyond the file's size. */
static int check_entry(MapFile *file, size_t k, size_t length, size_t *next) {
    if (!check_name(file, k)) {
        return 0;
    }
    const unsigned char *entry = entry_of(file, k);
    const size_t kind = u32_at(entry, KIND_AT), rank = u32_at(entry, RANK_AT), room = length - *next;
    int good = kind < N_KINDS && rank <= MOST_AXES;
    size_t count = 1;
    for (size_t axis = 0; good && axis < MOST_AXES; axis++) {
        const size_t along = length_along(entry, axis);
        good = axis < rank ? along == 0 || count <= length / along : along == 0;
        count *= axis < rank ? along : 1;
    }
    uint64_t position;
    memcpy(&position, entry + POSITION_AT, sizeof position);
    if (!good || position != *next || count > room / SIZE_OF[kind]) {
        return refuse(file, "'%s': kind, lengths or position cannot be", name_of(file, k));
    }
    const size_t size = count * SIZE_OF[kind], padded = size + (ALIGNMENT - size % ALIGNMENT) % ALIGNMENT;
    if (padded > room) {
        return refuse(file, "'%s': ends behind the file", name_of(file, k));
    }
    *next += padded;
    return kind != DOUBLES
        || check_finite(file, name_of(file, k), (const double *)(const void *)content_of(file, entry), count);
}

int map_open(MapFile *file, const unsigned char *bytes, size_t length, char text[MODEL_TEXT_SIZE]) {
    memset(file, 0, sizeof *file);
    file->bytes = bytes;
    file->text = text;
    file->good = resource_check(bytes, length, MAGIC, MAP_FORMAT_VERSION, "map", text);
    if (!file->good) {
        return 0;
    }
    const size_t count = u32_at(bytes, COUNT_AT);
    if (count > MOST_ARRAYS || length < TABLE_AT + count * ENTRY_SIZE) {
        return refuse(file, "has a table of %lu arrays, which cannot be", (unsigned long)count);
    }
    file->count = count;
    size_t next = TABLE_AT + count * ENTRY_SIZE;
    for (size_t k = 0; k < count; k++) {
        if (!check_entry(file, k, length, &next)) {
            return 0;
        }
    }
    return next == length ? 1 : refuse(file, "holds bytes that no array has");
}

/* The first array whose name is not less than this one, by bisection. */
static size_t place_of(const MapFile *file, const char *name) {
    size_t low = 0, high = file->count;
    while (low < high) {
        const size_t middle = low + (high - low) / 2;
        if (strcmp(name_of(file, middle), name) < 0) {
            low = middle + 1;
        } else {
            high = middle;
        }
    }
    return low;
}

int map_has(const MapFile *file, const char *part) {
    char prefix[NAME_SIZE];
    const int size = snprintf(prefix, sizeof prefix, "%s.", part);
    const size_t k = place_of(file, prefix);
    return k < file->count && strncmp(name_of(file, k), prefix, (size_t)size) == 0;
}

/* The entry of an array that must be there; NULL if something is wrong. */
static const unsigned char *find(MapFile *file, const char *name) {
    const size_t k = place_of(file, name);
    if (k == file->count || strcmp(name_of(file, k), name) != 0) {
        refuse(file, "'%s': is missing", name);
    }
    if (!file->good) {
        return NULL;
    }
    file->is_taken[k] = 1;
    return entry_of(file, k);
}

/* Kind and shape in words. */
static void describe(char *out, size_t size, size_t kind, const size_t *shape, size_t rank) {
    static const char *const WORDS[N_KINDS] = {"number", "whole number", "byte"};
    size_t used = 0;
    for (size_t axis = 0; axis < rank && used < size; axis++) {
        used += (size_t)snprintf(out + used, size - used, axis > 0 ? " x %lu" : "%lu", (unsigned long)shape[axis]);
    }
    if (used < size) {
        snprintf(out + used, size - used, rank > 0 ? " %ss" : "one %s", WORDS[kind]);
    }
}

/* The content of an array of a kind and shape; NULL if something is wrong. */
static const void *take(MapFile *file, const char *name, size_t kind, const size_t *shape, size_t rank) {
    const unsigned char *entry = find(file, name);
    if (entry == NULL) {
        return NULL;
    }
    const size_t found_kind = u32_at(entry, KIND_AT), found_rank = u32_at(entry, RANK_AT);
    size_t found_shape[MOST_AXES];
    int same = found_kind == kind && found_rank == rank;
    for (size_t axis = 0; axis < found_rank; axis++) {
        found_shape[axis] = length_along(entry, axis);
        same = same && found_shape[axis] == shape[axis];
    }
    if (!same) {
        char expected[80], found[80];
        describe(expected, sizeof expected, kind, shape, rank);
        describe(found, sizeof found, found_kind, found_shape, found_rank);
        refuse(file, "'%s': expected %s, found %s", name, expected, found);
        return NULL;
    }
    return content_of(file, entry);
}

static size_t length_of(const MapFile *file, const MapLength *length) {
    return (size_t)((long)file->length[length->symbol] * length->times + length->plus);
}

static size_t take_length(MapFile *file, const char *name, size_t axis, size_t least, size_t most) {
    const unsigned char *entry = find(file, name);
    if (entry == NULL) {
        return 0;
    }
    const size_t found = axis < u32_at(entry, RANK_AT) ? length_along(entry, axis) : 0;
    if (found < least || found > most) {
        refuse(file, "'%s': expected %lu to %lu values along axis %lu, found %lu", name, (unsigned long)least,
               (unsigned long)most, (unsigned long)axis, (unsigned long)found);
        return 0;
    }
    return found;
}

static size_t take_count(MapFile *file, const char *name, size_t least, size_t most) {
    int32_t value = 0;
    const void *content = take(file, name, INTEGERS, NULL, 0);
    if (content == NULL) {
        return 0;
    }
    memcpy(&value, content, sizeof value);
    if (value < 0 || (size_t)value < least || (size_t)value > most) {
        refuse(file, "'%s': expected a whole number from %lu to %lu, found %ld", name, (unsigned long)least,
               (unsigned long)most, (long)value);
        return 0;
    }
    return (size_t)value;
}

static const char *take_texts(MapFile *file, const char *name, size_t rows, size_t width) {
    const char *text = take(file, name, TEXTS, (const size_t[]){rows, width}, 2);
    for (size_t row = 0; text != NULL && row < rows; row++) {
        map_require(file, memchr(text + row * width, '\0', width) != NULL, name, "texts with an end");
    }
    return text;
}

const char *map_text(MapFile *file, const char *name, size_t width) {
    return take_texts(file, name, 1, take_length(file, name, 1, 1, width));
}

/* Require `count` values, `step` apart, above zero. */
static void require_positive(MapFile *file, const char *name, const double *value, size_t count, size_t step) {
    for (size_t i = 0; i < count; i++) {
        if (!(value[i * step] > 0.0)) {
            refuse(file, "'%s': expected numbers above zero, found %g (number %lu)", name, value[i * step],
                   (unsigned long)(i * step));
        }
    }
}

/* Require what the rule of an array states of its finite values. */
static void require_rule(MapFile *file, const char *name, const MapRow *row, const double *value, size_t count) {
    switch (row->rule) {
    case MAP_POSITIVE:
        require_positive(file, name, value, count, 1);
        break;
    case MAP_COVARIANCE: {
        const size_t n = length_of(file, &row->length[0]);
        require_positive(file, name, value, n, n + 1);
        break;
    }
    case MAP_BETWEEN:
        map_require_between(file, name, *value, row->low, row->high);
        break;
    case MAP_FROM_0:
        for (size_t i = 0; i < count; i++) {
            map_require(file, value[i] >= 0.0, name, "no number below zero");
        }
        break;
    case MAP_INCREASING:
        for (size_t i = 1; i < count; i++) {
            map_require(file, value[i] > value[i - 1], name, "numbers that increase");
        }
        break;
    case MAP_RANGE:
        map_require(file, value[0] > 0.0 && value[1] >= value[0], name, "a range above zero");
        break;
    default:
        break;
    }
}

/* Copy values. Bounds that a map does not state are the largest numbers of the file, which holds finite ones alone. */
static void copy_values(double *member, const double *value, size_t count, int rule) {
    for (size_t i = 0; i < count; i++) {
        const int is_none = rule == MAP_BOUNDS && fabs(value[i]) >= DBL_MAX;
        member[i] = is_none ? copysign(INFINITY, value[i]) : value[i];
    }
}

static void read_numbers(MapFile *file, const char *name, const MapRow *row, void *member) {
    size_t shape[MOST_AXES], count = 1;
    for (size_t axis = 0; axis < row->rank; axis++) {
        shape[axis] = length_of(file, &row->length[axis]);
        count *= shape[axis];
    }
    const double *value = take(file, name, DOUBLES, shape, row->rank);
    if (value == NULL) {
        return;
    }
    require_rule(file, name, row, value, count);
    if (row->kind == MAP_ARRAY) {
        memcpy(member, &value, sizeof value);
    } else {
        copy_values(member, value, count, row->rule);
    }
}

static void read_row(MapFile *file, const char *name, const MapRow *row, void *member) {
    size_t count;
    int whole;
    const char *text;
    switch (row->kind) {
    case MAP_LENGTH:
        count = take_length(file, name, row->rank, length_of(file, &row->length[0]), length_of(file, &row->length[1]));
        memcpy(member, &count, sizeof count);
        file->length[row->symbol] = count;
        break;
    case MAP_WHOLE:
    case MAP_COUNT:
        count = row->high > 0.0 ? (size_t)row->high : length_of(file, &row->length[0]);
        count = take_count(file, name, (size_t)row->low, count);
        if (row->kind == MAP_COUNT) {
            memcpy(member, &count, sizeof count);
        } else {
            whole = (int)count;
            memcpy(member, &whole, sizeof whole);
        }
        break;
    case MAP_TEXT:
        text = take_texts(file, name, length_of(file, &row->length[0]), length_of(file, &row->length[1]));
        memcpy(member, &text, sizeof text);
        break;
    default:
        read_numbers(file, name, row, member);
    }
}

int map_read(MapFile *file, const char *part, const MapRow *row, size_t count, void *into) {
    for (size_t k = 0; file->good && k < count; k++) {
        char name[NAME_SIZE];
        snprintf(name, sizeof name, "%s.%s", part, row[k].name);
        read_row(file, name, &row[k], (unsigned char *)into + row[k].member);
    }
    return file->good;
}

int map_require_between(MapFile *file, const char *name, double value, double low, double high) {
    const int is_between = value >= low && value <= high;
    return is_between ? file->good : refuse(file, "'%s': expected a number from %g to %g, found %g", name, low, high, value);
}

int map_require(MapFile *file, int condition, const char *name, const char *expected) {
    return condition ? file->good : refuse(file, "'%s': expected %s", name, expected);
}

int map_hand_out(MapFile *file, ListPieces *list, void *part) {
    const int good = file->good && memory_hand_out(file->memory, list, part);
    return good || refuse(file, "needs more memory than there is");
}

int map_close(MapFile *file) {
    for (size_t k = 0; k < file->count; k++) {
        if (!file->is_taken[k]) {
            return refuse(file, "'%s': is no array of this map", name_of(file, k));
        }
    }
    return file->good;
}
