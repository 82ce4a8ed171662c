/* One sample after another by the filter of a linear map: strainfmu/estimator/reference/linear_filter.py. */

#include <math.h>

#include "../estimator.h"
#include "../step_parts.h"
#include "linear_filter.h"

int linear_filters(const Estimator *e) {
    const int takes_steps = (e->base.mode & (EVENT | CONTINUOUS_TIME)) == 0; /* not in model exchange */
    return e->linear_filter.present && takes_steps && e->input[filter_setting(e)] > 0.0;
}

/* Whether the estimate of the sample alone is one, and strain fits the map. */
static int sample_fits(const Estimator *e) {
    const int health = (int)e->output[HEALTH_STATE];
    return health != INVALID && health != UNIDENTIFIED && health != NO_COEFFICIENTS
        && e->output[CHI_SQUARE] <= e->output[CHI_SQUARE_LIMIT];
}

/* Alarm level of the normalised innovation, whose degrees of freedom are all gauges in use. */
static double innovation_limit(const Estimator *e) {
    const double whole = e->map.chi_square_limit[e->masked->n_used - 1], own = e->masked->chi_square_limit;
    return isfinite(own) ? e->output[CHI_SQUARE_LIMIT] / own * whole : whole;
}

static void set_sample(Estimator *e) {
    LinearFilter *filter = &e->linear_filter;
    const Map *map = &e->map;
    filter->ratio = map->scaled ? e->scaled.step.ratio : 1.0;
    for (size_t g = 0; g < map->n_gauges; g++) {
        const double expected = map->scaled ? map->form.fixed_strain[g] + filter->ratio * map->form.mean_strain[g]
                                            : map->mean_strain[g];
        filter->used[g] = e->masked->mask[g];
        filter->apart[g] = filter->used[g] ? e->strain[g] - expected : 0.0;
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
static void set_deviations(Estimator *e, const double *by, const double *scale) {
    const int scaled = e->map.scaled;
    const double shift = moment_shift(e);
    double covariance[N_LOADS * N_LOADS], per_pressure[N_LOADS] = {0.0}, load[N_LOADS], coefficient[N_LOADS];
    memcpy(covariance, scaled ? e->scaled.step.covariance : e->masked->load_covariance, sizeof covariance);
    if (scaled) {
        memcpy(per_pressure, e->scaled.step.per_pressure, sizeof per_pressure);
    }
    move_covariance(shift, covariance);
    move_moments(shift, per_pressure);
    int positive = 1;
    for (size_t i = 0; i < N_LOADS; i++) {
        const size_t at = i * N_LOADS + i;
        /* Loads and coefficients are still those of the sample alone. */
        const double deviation = e->output[COEFFICIENTS_STD + i];
        coefficient[i] = deviation * deviation + scale[i] * scale[i] * by[at];
        positive = positive && coefficient[i] > 0.0;
        for (size_t j = 0; j < N_LOADS; j++) {
            covariance[i * N_LOADS + j] += per_pressure[i] * per_pressure[j] * (e->flow.deviation * e->flow.deviation)
                                         + by[i * N_LOADS + j];
        }
        load[i] = covariance[at];
    }
    LinearFilter *filter = &e->linear_filter;
    filter->has_change = positive && is_positive(covariance);
    if (filter->has_change) {
        memcpy(filter->change, by, sizeof filter->change);
        for (size_t i = 0; i < N_LOADS; i++) {
            e->output[LOADS_STD + i] = sqrt(load[i]);
            e->output[COEFFICIENTS_STD + i] = sqrt(coefficient[i]);
        }
    }
}

/* Loads and coefficients of the law in filter->next_law. */
static void write_loads(Estimator *e) {
    const double *scalar = e->input + e->map.n_gauges;
    const double shift = moment_shift(e);
    double apart[N_LOADS], by[N_LOADS * N_LOADS], scale[N_LOADS];
    linear_filter_loads(&e->linear_filter, &e->linear_filter.next_law, apart, by);
    move_moments(shift, apart);
    move_covariance(shift, by);
    coefficient_scales(e->flow.pressure, scalar[REFERENCE_AREA], scalar[REFERENCE_LENGTH], scale);
    set_deviations(e, by, scale);
    for (size_t i = 0; i < N_LOADS; i++) {
        e->output[LOADS + i] += apart[i];
        e->output[COEFFICIENTS + i] += scale[i] * apart[i];
    }
}

void linear_filter_outputs(Estimator *e) {
    LinearFilter *filter = &e->linear_filter;
    zero_errors_take(&filter->zeros, zeros_in_use(e));
    const int has_law = filter->base.has_law != 0.0 && zero_errors_same(&filter->zeros, filter->law.zero);
    const double elapsed = filter->base.now - filter->base.time, longest = filter->map.largest_time;
    filter->next = filter->base;
    filter->next.has_law = has_law;
    filter->next.time = filter->base.now;
    filter->has_change = 0;
    if (has_law) {
        const double seconds = elapsed > 0.0 ? (elapsed < longest ? elapsed : longest) : 0.0;
        linear_filter_predict(filter, seconds, e->input[filter_setting(e)]);
    }
    if (!sample_fits(e)) {
        const LinearLaw kept = filter->next_law;
        filter->next_law = filter->predicted;
        filter->predicted = kept;
        return;
    }
    set_sample(e);
    filter->next.has_law = 1.0;
    if (has_law && linear_filter_update(filter, &filter->predicted) <= innovation_limit(e)) {
        write_loads(e);
        return;
    }
    linear_filter_set_stationary(filter);
    linear_filter_update(filter, &filter->stationary);
}

/* What the step left is what the next one starts from, at the present point in time. */
static void take_next(Estimator *e) {
    LinearFilter *filter = &e->linear_filter;
    const LinearLaw law = filter->law;
    filter->law = filter->next_law;
    filter->next_law = law;
    filter->base = filter->next;
    filter->base.stepped = 0.0;
    filter->base.now = e->base.time;
}

void linear_filter_before_change(Estimator *e) {
    if (e->linear_filter.base.stepped != 0.0) {
        estimator_outputs(e);
        take_next(e);
        e->outdated = 1;
    }
}

void linear_filter_step(Estimator *e, double start) {
    LinearFilter *filter = &e->linear_filter;
    linear_filter_before_change(e);
    if (!linear_filters(e)) {
        filter->base.has_law = 0.0;
        return;
    }
    if (filter->base.now != start) {
        filter->base.now = start;
        e->outdated = 1;
    }
    estimator_outputs(e);
    filter->base.stepped = 1.0;
}
