/* Loads from strain: of the built-in samples, or of a table.

       example                       prints the loads of samples.c, and compares all outputs with those of strainfmu
       example FILE.csv [SECONDS]    prints all outputs of each row of a table, as a table

   The first line of a table names its columns: time [s], and inputs with their index from 1 where a field has several
   values: strain[1], strain[2], dynamic_pressure. README.txt lists the fields and their units. An input that has no
   column, or an empty entry, is not known. SECONDS is the time constant of the filter; without it there is none. */

#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "estimator/interface/strainload.h"
#include "map_data.h"
#include "positions.h"
#include "samples.h"

enum { LINE_SIZE = 1 << 17, MOST_COLUMNS = 4096, N_LOADS = 5 };

static const char *const HEALTH[] = {"OK",       "INCONSISTENT", "NO_COEFFICIENTS", "INVALID",
                                     "DEGRADED", "UNIDENTIFIED", "SUSPECT",         "OUTSIDE"};
static const char *const LOAD[N_LOADS] = {"axial +- sigma [N]", "normal [N]", "side [N]", "pitch [N m]", "yaw [N m]"};
static const size_t TIME = SIZE_MAX; /* what a column holds, if it is no input */

static void fail(const char *what, const char *detail) {
    fprintf(stderr, "example: %s%s\n", what, detail);
    exit(1);
}

/* Position of the first value of a field; the field must be there. */
static size_t first_of(const StrainLoad *handle, int record, const char *name) {
    SlField field;
    for (size_t k = 0; sl_field(handle, record, k, &field); k++) {
        if (strcmp(field.name, name) == 0 && field.count > 0) {
            return field.first;
        }
    }
    fail("this map has no ", name);
    return 0;
}

/* Whether one output has the bits of another, or both are no number. */
static int same_bits(double a, double b) {
    return (isnan(a) && isnan(b)) || memcmp(&a, &b, sizeof a) == 0;
}

/* The built-in samples: the five loads, each with its standard deviation, and health. */
static int run_samples(StrainLoad *handle, double *output) {
    const size_t n_inputs = sl_size(handle, SL_INPUTS), n_outputs = sl_size(handle, SL_OUTPUTS);
    const double *load = output + SL_OUT_LOADS, *std = output + SL_OUT_LOADS_STD, *health = output + SL_OUT_HEALTH;
    size_t others = 0;
    double largest = 0.0;
    printf("time [s]");
    for (size_t i = 0; i < N_LOADS; i++) {
        printf(" %20s", LOAD[i]);
    }
    printf("    health\n");
    for (size_t k = 0; k < sl_sample_count; k++) {
        sl_step(handle, sl_sample_time[k], sl_sample_input + k * n_inputs, NULL, output);
        printf("%8.2f", sl_sample_time[k]);
        for (size_t i = 0; i < N_LOADS; i++) {
            printf(" %10.1f +-%7.1f", load[i], std[i]);
        }
        printf("    %s\n", HEALTH[(int)*health]);
        for (size_t i = 0; i < n_outputs; i++) {
            const double expected = sl_sample_output[k * n_outputs + i];
            if (!same_bits(output[i], expected)) {
                const double off = fabs(output[i] - expected) / fabs(expected);
                largest = off > largest || isnan(off) ? off : largest;
                others++;
            }
        }
    }
    if (others == 0) {
        printf("All %lu outputs have the bits that strainfmu computes.\n", (unsigned long)(sl_sample_count * n_outputs));
    } else {
        printf("%lu outputs differ from those of strainfmu, by up to %.1e of their value.\n", (unsigned long)others,
               largest);
    }
    return largest <= 1e-6 ? 0 : 1;
}

/* The entry that *rest begins with, without quotes; *rest moves behind it, to NULL behind the last one. */
static char *next_entry(char **rest) {
    char *entry = *rest, *end = entry + strcspn(entry, ",\r\n");
    *rest = *end == ',' ? end + 1 : NULL;
    *end = '\0';
    entry += *entry == '"';
    entry[strcspn(entry, "\"")] = '\0';
    return entry;
}

/* The place of an input by the name of its column. */
static size_t place_of(const StrainLoad *handle, const char *name) {
    const size_t length = strcspn(name, "[");
    const unsigned long index = name[length] == '[' ? strtoul(name + length + 1, NULL, 10) : 1;
    SlField field;
    for (size_t k = 0; sl_field(handle, SL_INPUTS, k, &field); k++) {
        if (strlen(field.name) == length && strncmp(field.name, name, length) == 0 && index >= 1 && index <= field.count
            && (name[length] != '\0' || field.count == 1)) {
            return field.first + (index - 1);
        }
    }
    fail("the table has a column that is no input of this map: ", name);
    return TIME;
}

static void print_heading(const StrainLoad *handle) {
    SlField field;
    printf("time");
    for (size_t k = 0; sl_field(handle, SL_OUTPUTS, k, &field); k++) {
        for (size_t i = 1; i <= field.count; i++) {
            printf(field.count > 1 ? ",%s[%lu]" : ",%s", field.name, (unsigned long)i);
        }
    }
    printf("\n");
}

static int run_table(StrainLoad *handle, FILE *file, double *input, double *output) {
    static char line[LINE_SIZE];
    static size_t place[MOST_COLUMNS];
    const size_t n_inputs = sl_size(handle, SL_INPUTS), n_outputs = sl_size(handle, SL_OUTPUTS);
    size_t n_columns = 0, row = 0;
    for (char *rest = fgets(line, LINE_SIZE, file); rest != NULL && n_columns < MOST_COLUMNS; n_columns++) {
        const char *name = next_entry(&rest);
        place[n_columns] = strcmp(name, "time") == 0 ? TIME : place_of(handle, name);
    }
    print_heading(handle);
    for (; fgets(line, LINE_SIZE, file) != NULL; row++) {
        double time = 0.0;
        char *rest = line, *end;
        for (size_t i = 0; i < n_inputs; i++) {
            input[i] = NAN;
        }
        for (size_t c = 0; c < n_columns; c++) {
            const char *entry = rest != NULL ? next_entry(&rest) : "none";
            const double value = *entry == '\0' ? NAN : strtod(entry, &end);
            if (*entry != '\0' && *end != '\0') {
                fail("the table has an entry that is no number: ", entry);
            }
            *(place[c] == TIME ? &time : &input[place[c]]) = value;
        }
        sl_step(handle, time, input, NULL, output); /* NULL: all sensors may be used */
        printf("%.17g", time);
        for (size_t i = 0; i < n_outputs; i++) {
            printf(",%.17g", output[i]);
        }
        printf("\n");
    }
    return row > 0 ? 0 : 1;
}

int main(int count, char **words) {
    char text[SL_TEXT_SIZE];
    StrainLoad *handle = sl_open(sl_map_data, sl_map_size, text); /* the one place that allocates */
    if (handle == NULL) {
        fail("the map ", text);
    }
    double *input = calloc(sl_size(handle, SL_INPUTS), sizeof *input);
    double *output = calloc(sl_size(handle, SL_OUTPUTS), sizeof *output);
    FILE *file = count > 1 ? fopen(words[1], "r") : NULL;
    if (input == NULL || output == NULL || (count > 1 && file == NULL)) {
        fail("cannot open ", count > 1 ? words[1] : "the records");
    }
    if (count > 2) { /* a setting, which holds from here on */
        const double seconds = strtod(words[2], NULL);
        if (!sl_set(handle, first_of(handle, SL_SETTINGS, "filter_time_constant"), 1, &seconds, text)) {
            fail("the time constant of the filter: ", text);
        }
    }
    const int code = file == NULL ? run_samples(handle, output) : run_table(handle, file, input, output);
    if (file != NULL) {
        fclose(file);
    }
    free(input);
    free(output);
    sl_close(handle);
    return code;
}
