#include "linear_filter_step.h"

#include <math.h>

#include "linear_filter_update.h"
#include "predict.h"

/* Whether the estimate of the sample alone is one, and strain fits the map. */
static int sample_fits(const Linear *linear) {
    const int health = (int)linear->output[HEALTH_STATE];
    return health != INVALID && health != UNIDENTIFIED && health != NO_COEFFICIENTS
        && linear->output[CHI_SQUARE] <= linear->output[CHI_SQUARE_LIMIT];
}

/* Alarm level of the normalised innovation, whose degrees of freedom are all gauges in use. */
static double innovation_limit(const Linear *linear) {
    const MaskedMap *masked = linear->prepared.masked;
    const double whole = linear->map->chi_square_limit[masked->n_used - 1], own = masked->chi_square_limit;
    return isfinite(own) ? linear->output[CHI_SQUARE_LIMIT] / own * whole : whole;
}

static void set_sample(LinearFilter *filter, const Linear *linear) {
    const Map *map = linear->map;
    filter->ratio = linear->scaled.step.ratio;
    for (size_t g = 0; g < map->n_gauges; g++) {
        const double expected = map->form.fixed_strain[g] + filter->ratio * map->form.mean_strain[g];
        filter->used[g] = linear->prepared.masked->mask[g];
        filter->apart[g] = filter->used[g] ? linear->inputs->strain[g] - expected : 0.0;
    }
    linear_filter_read(filter);
}

/* T C T' for the transfer T to a moment point further aft. */
static void move_covariance(double shift, double *covariance) {
    for (size_t i = 0; i < N_LOADS; i++) {
        move_moments(shift, covariance + i * N_LOADS);
    }
    for (size_t j = 0; j < N_LOADS; j++) {
        for (size_t i = 3; i < N_LOADS; i++) {
            covariance[i * N_LOADS + j] += shift * covariance[(i - 2) * N_LOADS + j];
        }
    }
}

/* Whether a symmetric matrix is positive definite. */
static int is_positive(const double *covariance) {
    double root[N_LOADS][N_LOADS];
    for (size_t i = 0; i < N_LOADS; i++) {
        for (size_t j = 0; j <= i; j++) {
            const double own = covariance[i * N_LOADS + i], other = covariance[j * N_LOADS + j];
            if (!(own > 0.0)) {
                return 0;
            }
            double rest = covariance[i * N_LOADS + j] / (sqrt(own) * sqrt(other));
            for (size_t k = 0; k < j; k++) {
                rest -= root[i][k] * root[j][k];
            }
            if (i == j && !(rest > 0.0)) {
                return 0;
            }
            root[i][j] = i == j ? sqrt(rest) : rest / root[j][j];
        }
    }
    return 1;
}

/* Deviations of loads and coefficients with the change of the covariance by the law; those of the sample alone where the
   laws hold larger errors than those at the current strain. */
static void set_deviations(LinearFilter *filter, Linear *linear, const double *by, const double *scale) {
    const ScaledStep *step = &linear->scaled.step;
    const double shift = moment_shift(linear->inputs), deviation = linear->flow.deviation;
    double covariance[N_LOADS * N_LOADS], per_pressure[N_LOADS], load[N_LOADS], coefficient[N_LOADS];
    memcpy(covariance, step->covariance, sizeof covariance);
    memcpy(per_pressure, step->per_pressure, sizeof per_pressure);
    move_covariance(shift, covariance);
    move_moments(shift, per_pressure);
    int positive = 1;
    for (size_t i = 0; i < N_LOADS; i++) {
        const size_t at = i * N_LOADS + i;
        /* Loads and coefficients are still those of the sample alone. */
        const double own = linear->output[COEFFICIENTS_STD + i];
        coefficient[i] = own * own + scale[i] * scale[i] * by[at];
        positive = positive && coefficient[i] > 0.0;
        for (size_t j = 0; j < N_LOADS; j++) {
            const double of_pressure = per_pressure[i] * per_pressure[j] * (deviation * deviation);
            covariance[i * N_LOADS + j] += of_pressure + by[i * N_LOADS + j];
        }
        load[i] = covariance[at];
    }
    filter->has_change = positive && is_positive(covariance);
    if (filter->has_change) {
        memcpy(filter->change, by, sizeof filter->change);
        for (size_t i = 0; i < N_LOADS; i++) {
            linear->output[LOADS_STD + i] = sqrt(load[i]);
            linear->output[COEFFICIENTS_STD + i] = sqrt(coefficient[i]);
        }
    }
}

/* Loads and coefficients of the law in filter->laws.next_law. */
static void write_loads(LinearFilter *filter, Linear *linear) {
    const double *scalar = linear->inputs->value + linear->map->n_gauges;
    const double shift = moment_shift(linear->inputs);
    double apart[N_LOADS], by[N_LOADS * N_LOADS], scale[N_LOADS];
    linear_filter_loads(filter, &filter->laws.next_law, apart, by);
    move_moments(shift, apart);
    move_covariance(shift, by);
    coefficient_scales(linear->flow.pressure, scalar[REFERENCE_AREA], scalar[REFERENCE_LENGTH], scale);
    set_deviations(filter, linear, by, scale);
    for (size_t i = 0; i < N_LOADS; i++) {
        linear->output[LOADS + i] += apart[i];
        linear->output[COEFFICIENTS + i] += scale[i] * apart[i];
    }
}

void linear_filter_outputs(LinearFilter *filter, Linear *linear) {
    zero_errors_take(&filter->laws.zeros, linear->inputs->zeros);
    const int has_law = filter->base.has_law != 0.0 && laws_hold(&filter->laws);
    filter->next = filter->base;
    filter->next.has_law = has_law;
    filter->next.time = filter->base.now;
    filter->has_change = 0;
    if (has_law) {
        const double elapsed = elapsed_time(filter->base.time, filter->base.now, filter->map.largest_time);
        linear_filter_predict(filter, elapsed, linear->inputs->value[filter_setting(linear->inputs)]);
    }
    if (!sample_fits(linear)) {
        laws_keep_predicted(&filter->laws);
        return;
    }
    set_sample(filter, linear);
    filter->next.has_law = 1.0;
    if (has_law && linear_filter_update(filter, &filter->laws.predicted) <= innovation_limit(linear)) {
        write_loads(filter, linear);
        return;
    }
    laws_set_modes(&filter->laws);
    linear_filter_update(filter, &filter->laws.stationary);
}

void linear_filter_take_next(LinearFilter *filter, double time) {
    laws_take_next(&filter->laws);
    filter->base = filter->next;
    filter->base.stepped = 0.0;
    filter->base.now = time;
}
