#include "map_resource.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "uri_path.h"

#define MAGIC_SIZE 8
#define CHECKED_FROM 32 /* the checksum is over all bytes from here on */
#define N_SCALARS 10
#define BYTE_ORDER_MARK 0x01020304u
#define LARGEST_COUNT 4096
#define LARGEST_FILE ((size_t)1 << 30)

static const char MAGIC[MAGIC_SIZE] = "SFMUMAP";

/* Four bytes per round, each through its own table ("slicing"): Kounavis & Berry, ISCC 2005. The tables are made on
   the stack in a few microseconds, so that instances share nothing. */
uint32_t crc32(const unsigned char *bytes, size_t length) {
    uint32_t table[4][256];
    for (uint32_t i = 0; i < 256; i++) {
        uint32_t value = i;
        for (int bit = 0; bit < 8; bit++) {
            value = (value >> 1) ^ (value & 1u ? 0xEDB88320u : 0u);
        }
        table[0][i] = value;
    }
    for (int k = 1; k < 4; k++) {
        for (int i = 0; i < 256; i++) {
            table[k][i] = (table[k - 1][i] >> 8) ^ table[0][table[k - 1][i] & 0xFFu];
        }
    }
    uint32_t crc = 0xFFFFFFFFu;
    size_t place = 0;
    for (; place + 4 <= length; place += 4) {
        crc ^= u32_at(bytes, place);
        crc = table[3][crc & 0xFFu] ^ table[2][(crc >> 8) & 0xFFu] ^ table[1][(crc >> 16) & 0xFFu]
            ^ table[0][crc >> 24];
    }
    for (; place < length; place++) {
        crc = (crc >> 8) ^ table[0][(crc ^ bytes[place]) & 0xFFu];
    }
    return ~crc;
}

static size_t number_of_doubles(size_t n, size_t states) {
    const size_t loads = N_LOADS, triangle = n * (n + 1) / 2;
    return N_SCALARS + n + loads + loads * n + loads * loads + 4 * triangle + loads * n + loads * loads + states * n
         + states * loads + 3 * n;
}

int resource_check(const unsigned char *bytes, size_t length, const char *magic, int version, const char *kind,
                   char text[MAP_TEXT_SIZE]) {
    if (length < HEADER_SIZE || memcmp(bytes, magic, MAGIC_SIZE) != 0) {
        snprintf(text, MAP_TEXT_SIZE, "is no %s of an FMU (%lu bytes)", kind, (unsigned long)length);
        return 0;
    }
    if (u32_at(bytes, 12) != BYTE_ORDER_MARK) {
        snprintf(text, MAP_TEXT_SIZE, "has another byte order than this machine");
        return 0;
    }
    if (u32_at(bytes, 8) != (uint32_t)version) {
        snprintf(text, MAP_TEXT_SIZE, "has format version %lu, must be %d: export the FMU again",
                 (unsigned long)u32_at(bytes, 8), version);
        return 0;
    }
    uint64_t stated;
    memcpy(&stated, bytes + 16, sizeof stated);
    if (stated != length) {
        snprintf(text, MAP_TEXT_SIZE, "has %lu bytes, must have %.0f: the file is cut or extended",
                 (unsigned long)length, (double)stated);
        return 0;
    }
    if (u32_at(bytes, 24) != crc32(bytes + CHECKED_FROM, length - CHECKED_FROM) || u32_at(bytes, 28) != 0) {
        snprintf(text, MAP_TEXT_SIZE, "is damaged: its checksum is wrong");
        return 0;
    }
    return 1;
}

static int check_sizes(const unsigned char *bytes, size_t length, char *text) {
    const uint32_t n = u32_at(bytes, 32), states = u32_at(bytes, 36);
    const uint32_t freedom = u32_at(bytes, 40), known_prior = u32_at(bytes, 44);
    if (n < 1 || n > LARGEST_COUNT || states > LARGEST_COUNT || freedom < 1 || freedom > n || known_prior > 1) {
        snprintf(text, MAP_TEXT_SIZE, "is for %lu gauges, %lu states, %lu degrees of freedom, which cannot be",
                 (unsigned long)n, (unsigned long)states, (unsigned long)freedom);
        return 0;
    }
    if (length != HEADER_SIZE + 8 * number_of_doubles(n, states)) {
        snprintf(text, MAP_TEXT_SIZE, "has %lu bytes, which is wrong for %lu gauges and %lu states",
                 (unsigned long)length, (unsigned long)n, (unsigned long)states);
        return 0;
    }
    if (memchr(bytes + 48, '\0', HEADER_SIZE - 48) == NULL) {
        snprintf(text, MAP_TEXT_SIZE, "holds a guid without an end");
        return 0;
    }
    return 1;
}

static const double *take(const double **next, size_t count) {
    const double *array = *next;
    *next += count;
    return array;
}

static int check_values(const Map *map, const double *values, size_t count, char *text) {
    for (size_t i = 0; i < count; i++) {
        if (!isfinite(values[i])) {
            snprintf(text, MAP_TEXT_SIZE, "holds a value that is not finite (number %lu)", (unsigned long)i);
            return 0;
        }
    }
    const int positive = map->reference_area > 0.0 && map->reference_length > 0.0 && map->sensor_range > 0.0
                      && map->dynamic_pressure > 0.0 && map->least_dynamic_pressure > 0.0;
    if (!positive) {
        snprintf(text, MAP_TEXT_SIZE, "holds a reference quantity that is not positive");
    }
    return positive;
}

static void take_arrays(Map *map, const double *next) {
    const size_t n = map->n_gauges, states = map->n_states, triangle = n * (n + 1) / 2;
    const double *scalars = take(&next, N_SCALARS);
    map->reference_area = scalars[0];
    map->reference_length = scalars[1];
    map->moment_station = scalars[2];
    map->sensor_range = scalars[3];
    map->dynamic_pressure = scalars[4];
    map->least_information = scalars[5];
    map->ambiguous_correlation = scalars[6];
    map->least_dynamic_pressure = scalars[7];
    map->largest_sensor_range = scalars[8];
    map->largest_setting = scalars[9];
    map->mean_strain = take(&next, n);
    map->load_of_mean = take(&next, N_LOADS);
    map->load_gain = take(&next, N_LOADS * n);
    map->load_covariance = take(&next, N_LOADS * N_LOADS);
    map->residual_triangle = take(&next, triangle);
    map->gain_triangle = take(&next, triangle);
    map->noise_whitening = take(&next, triangle);
    map->noise_root = take(&next, triangle);
    map->regression = take(&next, N_LOADS * n);
    map->remainder = take(&next, N_LOADS * N_LOADS);
    map->state_operator = take(&next, states * n);
    map->load_per_state = take(&next, states * N_LOADS);
    map->least_precision = take(&next, n);
    map->chi_square_limit = take(&next, n);
    map->outlier_threshold = take(&next, n);
}

int map_parse(const unsigned char *bytes, size_t length, Map *map, char text[MAP_TEXT_SIZE]) {
    if (!resource_check(bytes, length, MAGIC, MAP_FORMAT_VERSION, "map", text) || !check_sizes(bytes, length, text)) {
        return 0;
    }
    map->n_gauges = u32_at(bytes, 32);
    map->n_states = u32_at(bytes, 36);
    map->degrees_of_freedom = (int)u32_at(bytes, 40);
    map->known_prior = (int)u32_at(bytes, 44);
    map->checksum = u32_at(bytes, 24);
    map->guid = (const char *)bytes + 48;
    const double *values = (const double *)(const void *)(bytes + HEADER_SIZE);
    take_arrays(map, values);
    return check_values(map, values, number_of_doubles(map->n_gauges, map->n_states), text);
}

unsigned char *map_read(const char *path, size_t *length, char text[MAP_TEXT_SIZE]) {
    FILE *file = open_file(path);
    if (file == NULL) {
        snprintf(text, MAP_TEXT_SIZE, "cannot be opened");
        return NULL;
    }
    unsigned char *bytes = NULL;
    const long size = fseek(file, 0, SEEK_END) == 0 ? ftell(file) : -1;
    if (size >= 0 && (size_t)size <= LARGEST_FILE && fseek(file, 0, SEEK_SET) == 0) {
        *length = (size_t)size;
        bytes = malloc(*length + 1); /* never of size 0 */
        if (bytes != NULL && fread(bytes, 1, *length, file) != *length) {
            free(bytes);
            bytes = NULL;
        }
    }
    fclose(file);
    if (bytes == NULL) {
        snprintf(text, MAP_TEXT_SIZE, "cannot be read");
    }
    return bytes;
}
