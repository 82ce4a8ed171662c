/* What a result rests on, for callers without FMI: covariances, residuals, gauges in use, at the settings of the
   sample.

   Loads move to the moment point by T = 1 + shift on the entries (moment, force), coefficients take a scale for each
   row, so that a covariance becomes T C T' + r r' with r the error of the dynamic pressure: df/dq s_q of loads,
   scale df/dq s_q - C s_q / q of coefficients (linear/linear_outputs.c). Covariances of filtered outputs are the
   sample's with rows and columns times the factors of the filter's channels. Without strain variances alone are
   known. A step does not compute what only these functions need. docs/howto/run_without_fmi.md. */

#include "interface.h"

#include <math.h>
#include <string.h>

#define N_ENTRIES (N_LOADS * N_LOADS)

/* T C T' + r r' of a row-wise 5 x 5 matrix. */
static void transferred(double transfer[N_LOADS][N_LOADS], const double *covariance, const double *more,
                        double *result) {
    double half[N_LOADS][N_LOADS];
    for (size_t i = 0; i < N_LOADS; i++) {
        for (size_t j = 0; j < N_LOADS; j++) {
            half[i][j] = 0.0;
            for (size_t k = 0; k < N_LOADS; k++) {
                half[i][j] += transfer[i][k] * covariance[k * N_LOADS + j];
            }
        }
    }
    for (size_t i = 0; i < N_LOADS; i++) {
        for (size_t j = 0; j < N_LOADS; j++) {
            double sum = more[i] * more[j];
            for (size_t k = 0; k < N_LOADS; k++) {
                sum += half[i][k] * transfer[j][k];
            }
            result[i * N_LOADS + j] = sum;
        }
    }
}

static const double ONES[N_LOADS] = {1.0, 1.0, 1.0, 1.0, 1.0}, NONE[N_LOADS] = {0.0};

/* Covariances of loads and coefficients of the linear map, both with the error of the dynamic pressure. */
static void linear_covariances(const Estimator *e, double *fit) {
    const double *scalar = e->inputs.value + e->map.n_gauges;
    const double q = e->linear.flow.pressure, q_std = e->linear.flow.deviation;
    const ScaledStep *step = &e->linear.scaled.step;
    double transfer[N_LOADS][N_LOADS], loads[N_LOADS], per_pressure[N_LOADS], scale[N_LOADS], of_coefficient[N_LOADS];
    memcpy(loads, step->loads, sizeof loads); /* the outputs may be filtered */
    move_moments(moment_shift(&e->inputs), loads);
    memcpy(per_pressure, step->per_pressure, sizeof per_pressure);
    move_moments(moment_shift(&e->inputs), per_pressure);
    moment_transfer(&e->inputs, ONES, transfer);
    for (size_t i = 0; i < N_LOADS; i++) {
        per_pressure[i] = e->linear.flow.known ? per_pressure[i] * q_std : 0.0;
    }
    transferred(transfer, step->covariance, per_pressure, fit + LOAD_COVARIANCE);
    if (!e->linear.flow.known) {
        return;
    }
    coefficient_scales(q, scalar[REFERENCE_AREA], scalar[REFERENCE_LENGTH], scale);
    moment_transfer(&e->inputs, scale, transfer);
    for (size_t i = 0; i < N_LOADS; i++) {
        const double coefficient = scale[i] * loads[i];
        of_coefficient[i] = scale[i] * per_pressure[i] - coefficient / q * q_std;
    }
    transferred(transfer, step->covariance, of_coefficient, fit + COEFFICIENT_COVARIANCE);
}

/* The same of the nonlinear estimator. */
static void flight_covariances(const Estimator *e, double *fit) {
    const Solution *solution = &e->flight.solver.solution;
    double of_loads[N_LOADS][N_LOADS], of_coefficients[N_LOADS][N_LOADS];
    flight_transfers(&e->flight, of_loads, of_coefficients);
    transferred(of_loads, solution->load_covariance, NONE, fit + LOAD_COVARIANCE);
    transferred(of_coefficients, solution->coefficient_covariance, NONE, fit + COEFFICIENT_COVARIANCE);
}

static void write_filtered(const Estimator *e, double *fit) {
    const Filter *filter = &e->filter;
    scale_covariance(N_LOADS, filter->factor + LOAD_CHANNELS, fit + LOAD_COVARIANCE);
    scale_covariance(N_LOADS, filter->factor + COEFFICIENT_CHANNELS, fit + COEFFICIENT_COVARIANCE);
    if (e->flight.present) {
        memcpy(fit + FLIGHT_STATE, filter->mean + STATE_CHANNELS, N_STATES * sizeof *fit);
        scale_covariance(N_STATES, filter->factor + STATE_CHANNELS, fit + FLIGHT_STATE_COVARIANCE);
    }
}

/* Without strain: variances alone. */
static void write_coasted(const Estimator *e, double *fit) {
    const Solution *solution = &e->flight.solver.solution;
    memset(fit + LOAD_COVARIANCE, 0, 2 * N_ENTRIES * sizeof *fit);
    for (size_t i = 0; i < N_LOADS; i++) {
        const double load = e->output[LOADS_STD + i], coefficient = e->output[COEFFICIENTS_STD + i];
        fit[LOAD_COVARIANCE + i * (N_LOADS + 1)] = load * load;
        fit[COEFFICIENT_COVARIANCE + i * (N_LOADS + 1)] = coefficient * coefficient;
    }
    memcpy(fit + FLIGHT_STATE, solution->state, sizeof solution->state);
    memcpy(fit + FLIGHT_STATE_COVARIANCE, solution->widened_covariance, sizeof solution->widened_covariance);
}

/* Gauges in use, and those that the largest residual points to. */
static void write_gauges(const Estimator *e, double *used, double *suspect) {
    const double range = e->inputs.value[e->map.n_gauges + SENSOR_RANGE];
    const size_t first = (size_t)e->output[SUSPECT_GAUGE];
    const int silent = readings_silent(&e->inputs);
    for (size_t i = 0; i < e->map.n_gauges; i++) {
        used[i] = (double)(!silent && gauge_in_use(&e->inputs, i, range));
        suspect[i] = 0.0;
    }
    if (first == 0) {
        return;
    }
    suspect[first - 1] = 1.0;
    if (e->flight.present) {
        return;
    }
    /* The first suspect is the one that its group is numbered by. */
    const MaskedMap *m = e->linear.prepared.masked;
    for (size_t k = 0; k < m->n_used; k++) {
        if (m->used[e->linear.prepared.group[k]] == first - 1) {
            suspect[m->used[k]] = 1.0;
        }
    }
}

static void write_flight_fit(Estimator *e, double *fit, double *z) {
    const FlightMap *map = &e->flight.map;
    const Solution *solution = &e->flight.solver.solution;
    const int linear = e->flight.flag[LINEAR_LOADS];
    if (isnan(e->output[LOADS])) {
        return;
    }
    if (e->filter.present && e->filter.coasts) {
        write_coasted(e, fit);
        return;
    }
    if (linear) {
        linear_covariances(e, fit);
    } else {
        flight_covariances(e, fit);
    }
    fit[FITS] = (double)e->flight.fits;
    memcpy(fit + FLIGHT_STATE, solution->state, sizeof solution->state);
    memcpy(fit + FLIGHT_STATE_COVARIANCE, solution->widened_covariance, sizeof solution->widened_covariance);
    memcpy(fit + AIR_DATA_RESIDUAL, solution->navigation_residual, sizeof solution->navigation_residual);
    fit[DISCREPANCY_CHI_SQUARE] = solution->shape_square;
    fit[RESIDUAL_LIMIT] = map->outlier_threshold * sqrt(map->outlier_scale * e->inputs.value[e->map.n_gauges + ALARM_SCALE]);
    memcpy(z, solution->standardised_residual, e->map.n_gauges * sizeof *z);
}

static void write_linear_fit(Estimator *e, double *fit, double *z) {
    const MaskedMap *m = e->linear.prepared.masked;
    if (!m->identified) {
        return;
    }
    fit[FITS] = (double)(e->output[CHI_SQUARE] <= e->output[CHI_SQUARE_LIMIT]);
    if (e->map.form.follows_pressure && !e->linear.flow.known) {
        return;
    }
    const double ratio = e->linear.scaled.step.limit_ratio;
    const double scale = e->map.outlier_scale * (e->inputs.value[e->map.n_gauges + ALARM_SCALE] * ratio);
    fit[RESIDUAL_LIMIT] = m->outlier_threshold * sqrt(scale);
    memset(z, 0, e->map.n_gauges * sizeof *z);
    scaled_standardised_residuals(&e->linear.scaled, z);
    linear_covariances(e, fit);
}

double degrees_of_freedom(const Estimator *e) {
    const MaskedMap *m = e->linear.prepared.masked;
    if (e->flight.present) {
        return isnan(e->output[LOADS]) ? 0.0 : e->flight.degrees_of_freedom;
    }
    if (!m->identified || (e->map.form.follows_pressure && !e->linear.flow.known)) {
        return 0.0;
    }
    const int lost = (int)(e->map.n_gauges - m->n_used);
    return (double)(e->map.degrees_of_freedom > lost ? e->map.degrees_of_freedom - lost : 0);
}

void write_fit(Estimator *e, double *fit) {
    const size_t n = e->map.n_gauges;
    double *z = fit + OF_GAUGES;
    for (size_t k = 0; k < OF_GAUGES + n; k++) {
        fit[k] = NAN;
    }
    fit[FITS] = 0.0;
    if (e->flight.present) {
        write_flight_fit(e, fit, z);
    } else {
        write_linear_fit(e, fit, z);
    }
    fit[NOISE_LEFT] = e->filter.present ? e->filter.part_left : 1.0;
    if (fit[NOISE_LEFT] < 1.0) {
        write_filtered(e, fit);
    }
    write_gauges(e, z + n, z + 2 * n);
}
