/* Whether suspects found with the screen in float are those of z itself, close to the threshold and far from it.

     screen MAP.BIN      prints how many inputs were tried, and of how many the screen alone decided

   One gauge after the other is given a bias at which its |z| crosses the threshold, found by bisection down to
   neighbouring numbers; alarm scales move threshold and bias together over the whole range of float. */

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/resource.h"
#include "estimator/estimator.h"

#define MAX_GAUGES 64

static long tried, screened;
static double z_scale[MAX_GAUGES]; /* (n_used) bias of a z of 1; 0 where no other gauge checks one */

static double threshold_of(const Estimator *e) {
    const double scale = scalar_input(&e->inputs, ALARM_SCALE) * e->map.outlier_scale;
    return sqrt(scale) * e->linear.prepared.masked->outlier_threshold;
}

/* z (n_used) by the product in double. */
static void exact_z(Estimator *e, double *z) {
    double of_gauge[MAX_GAUGES];
    const MaskedMap *m = e->linear.prepared.masked;
    scaled_standardised_residuals(&e->linear.scaled, of_gauge);
    for (size_t k = 0; k < m->n_used; k++) {
        z[k] = of_gauge[m->used[k]];
    }
}

/* Strains of the mean state and up to one deviation more or less, in the measure of the alarm level. */
static void set_background(Estimator *e, double size) {
    unsigned long random = 1;
    for (size_t k = 0; k < e->linear.prepared.masked->n_used; k++) {
        random = (random * 1103515245u + 12345u) & 0x7FFFFFFFu;
        const double part = 2.0 * (double)random / 2147483647.0 - 1.0;
        const size_t gauge = e->linear.prepared.masked->used[k];
        e->inputs.value[gauge] = e->map.mean_strain[gauge] + size * part * z_scale[k];
    }
}

/* Compute the outputs, and compare suspects with those of the exact z. */
static void compare(Estimator *e) {
    double z[MAX_GAUGES], largest = 0.0, *of_screen = e->linear.scaled.step.z;
    size_t worst = 0, suspects = 0;
    e->outdated = 1;
    *of_screen = -1e300; /* stays if the screen alone decides */
    const double *output = estimator_outputs(e);
    const MaskedMap *m = e->linear.prepared.masked;
    const size_t *group = e->linear.prepared.group;
    exact_z(e, z);
    for (size_t k = 0; k < m->n_used; k++) {
        worst = fabs(z[k]) > largest ? k : worst;
        largest = fabs(z[k]) > largest ? fabs(z[k]) : largest;
    }
    const int above = largest > threshold_of(e);
    for (size_t k = 0; above && k < m->n_used; k++) {
        suspects += group[k] == group[worst];
    }
    const double gauge = above ? (double)(m->used[group[worst]] + 1) : 0.0;
    tried++;
    screened += *of_screen == -1e300;
    if (output[SUSPECT_GAUGE] != gauge || output[SUSPECTS] != (double)suspects) {
        fprintf(stderr, "|z| %.17g at threshold %.17g: gauge %g, %g suspects, exactly %g, %lu\n", largest,
                threshold_of(e), output[SUSPECT_GAUGE], output[SUSPECTS], gauge, (unsigned long)suspects);
        exit(1);
    }
}

/* |z| of gauge k of those in use, which reads off by bias. */
static double z_of(Estimator *e, size_t k, double bias) {
    double z[MAX_GAUGES];
    const MaskedMap *m = e->linear.prepared.masked;
    e->inputs.value[m->used[k]] = e->map.mean_strain[m->used[k]] + bias;
    compare(e);
    exact_z(e, z);
    return fabs(z[k]);
}

/* The strains are those of the mean state. */
static void set_scales(Estimator *e) {
    const double bias = 1e-3;
    for (size_t k = 0; k < e->linear.prepared.masked->n_used; k++) {
        const double z = z_of(e, k, bias);
        z_scale[k] = z > 0.0 ? bias / z : 0.0;
        z_of(e, k, 0.0);
    }
}

/* Biases on both sides of the one at which gauge k crosses the threshold. */
static void scan(Estimator *e, size_t k) {
    double low = 0.0, high = 100.0 * threshold_of(e) * z_scale[k];
    if (!(z_of(e, k, high) > threshold_of(e))) { /* no other gauge checks this one */
        return;
    }
    for (int halving = 0; halving < 60; halving++) {
        const double middle = low + (high - low) / 2.0;
        *(z_of(e, k, middle) > threshold_of(e) ? &high : &low) = middle;
    }
    for (double part = 1e-16; part < 0.9; part *= 1.5) {
        z_of(e, k, high * (1.0 + part));
        z_of(e, k, high * (1.0 - part));
    }
    z_of(e, k, 0.0);
}

int main(int argc, char **argv) {
    static const double SCALES[] = {1.0, 4.0, 1e-3, 1e3, 1e-12, 1e-30, 1e-80, 1e-100, 1e9, 1e20, 1e40, 1e100};
    char text[MODEL_TEXT_SIZE];
    size_t length;
    unsigned char *bytes = argc > 1 ? resource_read(argv[1], &length, text) : NULL;
    Memory memory = {NULL, NULL, 0, 0};
    Estimator *e = bytes != NULL ? estimator_create(&memory, bytes, length, text) : NULL;
    if (e == NULL || e->map.n_gauges > MAX_GAUGES) {
        return 2;
    }
    const size_t n = e->map.n_gauges;
    for (int run = 0; run < 4; run++) {
        e->linear.wide = run % 2 ? wide_of_processor() : 0;
        for (size_t s = 0; s < sizeof SCALES / sizeof *SCALES; s++) {
            estimator_reset(e);
            readings_note_given(&e->inputs, 0, n);
            e->inputs.valid[n / 2] = run < 2;
            e->inputs.value[n + SENSOR_RANGE] = 1e100;
            e->inputs.value[n + ALARM_SCALE] = SCALES[s];
            memcpy(e->inputs.value, e->map.mean_strain, n * sizeof *e->inputs.value);
            compare(e);
            set_scales(e);
            for (size_t k = 0; k < e->linear.prepared.masked->n_used; k++) {
                set_background(e, (double)(k % 3) * sqrt(SCALES[s]));
                scan(e, k);
            }
        }
    }
    printf("%ld %ld\n", tried, screened);
    memory_free(&memory);
    free(bytes);
    return 0;
}
