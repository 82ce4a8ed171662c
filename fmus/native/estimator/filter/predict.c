#include "predict.h"

#include <string.h>

#include "../../core/elementary.h"
#include "../numerics/products.h"

#define LARGEST_AGE 690.0 /* in time constants; nothing is left of a state beyond it */

double elapsed_time(double from, double to, double longest) {
    const double apart = to - from;
    return apart > 0.0 ? (apart < longest ? apart : longest) : 0.0;
}

static double left_after(double age) {
    return age < LARGEST_AGE ? exponential(-age) : 0.0;
}

void laws_set_modes(Laws *laws) {
    const size_t first = first_mode(laws);
    for (size_t mode = 0; mode < laws->n_modes; mode++) {
        double *row = laws->stationary.covariance + (first + mode) * laws->order + first;
        memset(row, 0, laws->n_modes * sizeof *row);
        thermal_add_left(laws->thermal, mode, 1.0, row);
    }
}

/* The step over a time [s]; the one before, if it was as long. */
static void set_motion(Laws *laws, double time_step, double time_constant) {
    Motion *motion = &laws->motion;
    if (motion->time_step == time_step && motion->time_constant == time_constant) {
        return;
    }
    for (size_t k = 0; k < laws->n_pairs; k++) {
        const double turn = laws->rate[k] * time_step, decay = left_after(turn);
        motion->pair[k][0][0] = decay * (1.0 + turn);
        motion->pair[k][0][1] = decay * time_step;
        motion->pair[k][1][0] = -decay * laws->rate[k] * turn;
        motion->pair[k][1][1] = decay * (1.0 - turn);
    }
    const double age = time_step / time_constant, fast = left_after(age), slow = left_after(age / laws->slow);
    for (size_t i = laws->n_pairs; i < first_rate(laws); i++) {
        motion->factor[i] = i >= laws->first_slow && i < laws->end_slow ? slow : fast;
    }
    motion->of_considered = fast;
    motion->time_step = time_step;
    motion->time_constant = time_constant;
}

void laws_move_rows(const Laws *laws, size_t count, double scale, const double *from, double *to) {
    const Motion *motion = &laws->motion;
    const size_t rates = first_rate(laws), shift = rates * count;
    for (size_t k = 0; k < laws->n_pairs; k++) {
        const double *x = from + k * count;
        for (size_t part = 0; part < 2; part++) {
            const double *row = motion->pair[k][part];
            combine(laws->wide, count, scale * row[0], x, scale * row[1], x + shift, to + k * count + part * shift);
        }
    }
    for (size_t i = laws->n_pairs; i < rates; i++) {
        const double *row = from + i * count;
        combine(laws->wide, count, scale * motion->factor[i], row, 0.0, row, to + i * count);
    }
}

/* One row times F'. */
static void move_columns(const Laws *laws, double *restrict row) {
    const Motion *motion = &laws->motion;
    const double *restrict factor = motion->factor;
    const size_t rates = first_rate(laws);
    for (size_t k = 0; k < laws->n_pairs; k++) {
        const double x = row[k], v = row[rates + k];
        row[k] = motion->pair[k][0][0] * x + motion->pair[k][0][1] * v;
        row[rates + k] = motion->pair[k][1][0] * x + motion->pair[k][1][1] * v;
    }
    for (size_t i = laws->n_pairs; i < rates; i++) {
        row[i] *= factor[i];
    }
}

/* Add what the process forgets: P - F P F' of the stationary P. */
static void add_forgotten(const Laws *laws, double widening, double *covariance) {
    const Motion *motion = &laws->motion;
    const size_t order = laws->order, rates = first_rate(laws), modes = first_mode(laws);
    const double *stationary = laws->stationary.covariance;
    for (size_t i = laws->n_pairs; i < modes; i++) {
        const int is_widened = i >= laws->first_widened && i < laws->end_widened;
        const double variance = (is_widened ? widening : 1.0) * stationary[i * (order + 1)];
        covariance[i * (order + 1)] += variance - motion->factor[i] * variance * motion->factor[i];
    }
    for (size_t mode = 0; mode < laws->n_modes; mode++) {
        const double factor = motion->factor[modes + mode];
        thermal_add_left(laws->thermal, mode, 1.0 - factor * factor, covariance + (modes + mode) * order + modes);
    }
    for (size_t k = 0; k < laws->n_pairs; k++) {
        const size_t at[2] = {k, rates + k};
        const double variance[2] = {stationary[at[0] * (order + 1)], stationary[at[1] * (order + 1)]};
        for (size_t i = 0; i < 2; i++) {
            for (size_t j = 0; j < 2; j++) {
                const double *a = motion->pair[k][i], *b = motion->pair[k][j];
                const double kept = a[0] * variance[0] * b[0] + a[1] * variance[1] * b[1];
                covariance[at[i] * order + at[j]] += (i == j ? variance[i] : 0.0) - kept;
            }
        }
    }
}

/* The mean of a symmetric matrix and its transpose, against round-off. */
static void symmetrise(size_t n, size_t order, double *matrix) {
    for (size_t i = 0; i < n; i++) {
        for (size_t j = 0; j < i; j++) {
            matrix[i * order + j] = matrix[j * order + i] = 0.5 * (matrix[i * order + j] + matrix[j * order + i]);
        }
    }
}

/* The mean, whose deviation from the stationary one is a state of the process, as is the deviation of a mode's amplitude
   from what the sensors of the sample say. */
static void move_mean(const Laws *laws, const Law *out) {
    const Law *law = &laws->law;
    const double *middle = laws->stationary.mean;
    memcpy(out->mean, law->mean, laws->order * sizeof *out->mean);
    for (size_t k = 0; k < laws->n_pairs; k++) {
        out->mean[k] -= middle[k];
    }
    if (memcmp(out->known, law->known, laws->n_sensors * sizeof *out->known) != 0) {
        for (size_t mode = 0; mode < laws->n_modes; mode++) {
            out->mean[first_mode(laws) + mode] += law->amplitude[mode] - out->amplitude[mode];
        }
    }
    move_columns(laws, out->mean);
    for (size_t k = 0; k < laws->n_pairs; k++) {
        out->mean[k] += middle[k];
    }
}

void laws_predict(Laws *laws, double time_step, double time_constant, double widening) {
    const size_t order = laws->order;
    Law *out = &laws->predicted;
    set_motion(laws, time_step, time_constant);
    law_note(laws, out);
    move_mean(laws, out);
    laws_move_rows(laws, order, 1.0, laws->law.covariance, out->covariance);
    for (size_t i = 0; i < laws->n; i++) {
        move_columns(laws, out->covariance + i * order);
    }
    add_forgotten(laws, widening, out->covariance);
    symmetrise(laws->n, order, out->covariance);
    if (laws->zeros.in_use) {
        laws_move_rows(laws, laws->zeros.columns, 1.0, laws->law.of_zeros, out->of_zeros);
    }
}

void laws_move_cross(Laws *laws) {
    laws_move_rows(laws, laws->n_considered, laws->motion.of_considered, laws->law.cross, laws->predicted.cross);
}
