#include "sections.h"

#include <stdio.h>

#define SECTION_HEADER 24

static const char NAMES[N_SECTION_KINDS][8] = {"FLIGHT", "THERMAL", "FURTHER", "FLOADS", "FILTER", "LFILTER", "TARE",
                                                 "PARAMS", "SENSORS", "KNOWN"};

/* The kind of the section that begins at bytes; N_SECTION_KINDS for none. */
static size_t kind_of(const unsigned char *bytes) {
    size_t kind = 0;
    while (kind < N_SECTION_KINDS && memcmp(bytes, NAMES[kind], sizeof NAMES[kind]) != 0) {
        kind++;
    }
    return kind;
}

int sections_find(const unsigned char *bytes, size_t length, size_t count, Section found[N_SECTION_KINDS],
                  char text[MODEL_TEXT_SIZE]) {
    memset(found, 0, N_SECTION_KINDS * sizeof *found);
    for (size_t k = 0; k < count; k++) {
        const size_t kind = length < SECTION_HEADER ? N_SECTION_KINDS : kind_of(bytes);
        if (kind == N_SECTION_KINDS || found[kind].content != NULL) {
            snprintf(text, MODEL_TEXT_SIZE, "holds a section that is not known");
            return 0;
        }
        uint64_t stated;
        memcpy(&stated, bytes + 8, sizeof stated);
        const size_t left = length - SECTION_HEADER;
        if (stated > left || stated % sizeof(double) != 0 || (k + 1 == count && stated != left)
            || u32_at(bytes, 16) != crc32(bytes + SECTION_HEADER, (size_t)stated)) {
            snprintf(text, MODEL_TEXT_SIZE, "is damaged: length or checksum of a section is wrong");
            return 0;
        }
        found[kind] = (Section){bytes + SECTION_HEADER, (size_t)stated};
        bytes += SECTION_HEADER + stated;
        length = left - (size_t)stated;
    }
    return 1;
}
