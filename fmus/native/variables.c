#include "variables.h"

#include <stdio.h>
#include <string.h>

int is_real_output(size_t variable) {
    return variable < HEALTH_STATE || variable == CHI_SQUARE || variable == CHI_SQUARE_LIMIT;
}

size_t input_place(const Estimator *e, size_t variable) {
    const size_t n = e->map.n_gauges;
    if (variable - N_OUTPUTS < n) { /* size_t: outputs wrap round to large numbers */
        return variable - N_OUTPUTS;
    }
    const size_t scalar = variable - (N_OUTPUTS + 2 * n);
    return scalar < N_SCALAR_INPUTS ? n + scalar : SIZE_MAX;
}

static int get_real(Estimator *e, size_t variable, double *value) {
    if (is_real_output(variable)) {
        *value = estimator_outputs(e)[variable];
        return 1;
    }
    const size_t place = input_place(e, variable);
    if (place == SIZE_MAX) {
        return 0;
    }
    *value = e->input[place];
    return 1;
}

/* Whether the variables listed follow each other without a gap. */
static int is_run(const unsigned *variable, size_t count) {
    unsigned gaps = 0;
    for (size_t k = 0; k < count; k++) {
        gaps |= variable[k] ^ (variable[0] + (unsigned)k);
    }
    return count > 0 && gaps == 0;
}

int get_reals(Estimator *e, size_t first, size_t count, double *value) {
    if (first < HEALTH_STATE && count <= HEALTH_STATE - first) {
        memcpy(value, estimator_outputs(e) + first, count * sizeof *value);
        return 1;
    }
    for (size_t k = 0; k < count; k++) {
        if (!get_real(e, first + k, value + k)) {
            return 0;
        }
    }
    return 1;
}

int get_listed_reals(Estimator *e, const unsigned *variable, size_t count, double *value) {
    if (is_run(variable, count)) {
        return get_reals(e, variable[0], count, value);
    }
    for (size_t k = 0; k < count; k++) {
        if (!get_real(e, variable[k], value + k)) {
            return 0;
        }
    }
    return 1;
}

int get_integer(Estimator *e, size_t variable, int *value) {
    if (variable != HEALTH_STATE && !(variable >= VALID_GAUGES && variable < N_OUTPUTS)) {
        return 0;
    }
    *value = (int)estimator_outputs(e)[variable];
    return 1;
}

int get_boolean(const Estimator *e, size_t variable, int *value) {
    const size_t gauge = variable - (N_OUTPUTS + e->map.n_gauges);
    if (gauge >= e->map.n_gauges) {
        return 0;
    }
    *value = e->valid[gauge];
    return 1;
}

static int no_input(const char *type, size_t variable, char *text) {
    snprintf(text, MAP_TEXT_SIZE, "variable %lu is no %s input or parameter", (unsigned long)variable, type);
    return 0;
}

static int set_real(Estimator *e, size_t variable, double value, char *text) {
    const size_t place = input_place(e, variable);
    if (place == SIZE_MAX) {
        return no_input("real", variable, text);
    }
    if (place >= e->map.n_gauges && !estimator_accepts(e, place, value, text)) {
        return 0;
    }
    e->input[place] = value;
    return 1;
}

int set_reals(Estimator *e, size_t first, size_t count, const double *value, char text[MAP_TEXT_SIZE]) {
    e->outdated = 1;
    const size_t n = e->map.n_gauges, gauge = first - N_OUTPUTS;
    if (gauge < n && count <= n - gauge) {
        memcpy(e->input + gauge, value, count * sizeof *value);
        return 1;
    }
    for (size_t k = 0; k < count; k++) {
        if (!set_real(e, first + k, value[k], text)) {
            return 0;
        }
    }
    return 1;
}

int set_listed_reals(Estimator *e, const unsigned *variable, size_t count, const double *value,
                     char text[MAP_TEXT_SIZE]) {
    if (is_run(variable, count)) {
        return set_reals(e, variable[0], count, value, text);
    }
    e->outdated = 1;
    for (size_t k = 0; k < count; k++) {
        if (!set_real(e, variable[k], value[k], text)) {
            return 0;
        }
    }
    return 1;
}

int set_boolean(Estimator *e, size_t variable, int value, char text[MAP_TEXT_SIZE]) {
    const size_t gauge = variable - (N_OUTPUTS + e->map.n_gauges);
    if (gauge >= e->map.n_gauges) {
        return no_input("Boolean", variable, text);
    }
    e->valid[gauge] = value != 0;
    e->outdated = 1;
    return 1;
}
