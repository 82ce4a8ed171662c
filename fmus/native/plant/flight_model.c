#include "flight_model.h"

#include <math.h>

#include "../core/elementary.h"

#define N_SIZES 11
#define N_POWERS 16
#define N_RADIAL 3 /* coefficients that incidence and Mach number alone decide: C_A, C_T, M_T */
#define MAX_COUNT 65536.0
#define ROUND_OFF 1e-9 /* fraction of the envelope that is no departure from it */

static const double GAS_CONSTANT = 287.053, HEAT_CAPACITY_RATIO = 1.4;

static const double *take(const double **next, size_t count) {
    const double *array = *next;
    *next += count;
    return array;
}

/* Whether a number is one that things can be counted with. */
static int countable(double value, double minimum) {
    return value >= minimum && value <= MAX_COUNT && value == (double)(size_t)value;
}

static size_t number_of_doubles(const FlightModel *m) {
    const size_t cells = (m->n_mach - 1) * (m->n_incidence - 1) * N_POWERS;
    return N_SIZES + m->n_mach + m->n_incidence + 6 * m->n_gauges + cells * N_RADIAL
         + cells * m->n_channel * m->n_harmonic * 2 + m->atmosphere.n_layers * LAYER_SIZE;
}

static int channels_exist(const FlightModel *m) {
    for (size_t i = 0; i < m->n_gauges; i++) {
        if (!countable(m->gauge_channel[i], 0.0) || m->gauge_channel[i] >= (double)m->n_channel) {
            return 0;
        }
    }
    return 1;
}

size_t flight_model_take(FlightModel *m, const double *data, size_t count) {
    static const double MINIMUM[] = {1.0, 2.0, 2.0, 1.0, 1.0, 1.0};
    if (count < N_SIZES) {
        return 0;
    }
    for (int k = 0; k < 6; k++) {
        if (!countable(data[k], MINIMUM[k])) {
            return 0;
        }
    }
    m->n_gauges = (size_t)data[0];
    m->n_mach = (size_t)data[1];
    m->n_incidence = (size_t)data[2];
    m->n_channel = (size_t)data[3];
    m->n_harmonic = (size_t)data[4];
    m->atmosphere.n_layers = (size_t)data[5];
    m->vented = data[6] != 0.0;
    m->internal_pressure = data[7];
    m->base_area = data[8];
    m->reference_area = data[9];
    m->reference_length = data[10];
    const double cells = (double)m->n_mach * (double)m->n_incidence * N_POWERS;
    if (cells * (double)m->n_channel * (double)m->n_harmonic > 1e9 || number_of_doubles(m) > count) {
        return 0;
    }
    const double *next = data + N_SIZES;
    const size_t table = (m->n_mach - 1) * (m->n_incidence - 1) * N_POWERS;
    m->mach_knots = take(&next, m->n_mach);
    m->incidence_knots = take(&next, m->n_incidence);
    m->gauge_cosine = take(&next, m->n_gauges);
    m->gauge_sine = take(&next, m->n_gauges);
    m->gauge_channel = take(&next, m->n_gauges);
    m->strain_of_internal_pressure = take(&next, m->n_gauges);
    m->apparent_strain = take(&next, m->n_gauges);
    m->noise_scale = take(&next, m->n_gauges);
    m->coefficient_table = take(&next, table * N_RADIAL);
    m->strain_table = take(&next, table * m->n_channel * m->n_harmonic * 2);
    m->atmosphere.layer = take(&next, m->atmosphere.n_layers * LAYER_SIZE);
    return channels_exist(m) ? number_of_doubles(m) : 0;
}

size_t flight_model_work(const FlightModel *m) {
    return m->n_channel * m->n_harmonic * 2;
}

/* Find the cell that holds value and the distance from its lower knot; 0 outside the knots. */
static int find_cell(const double *knots, size_t n, double value, size_t *cell, double *step) {
    const double slack = ROUND_OFF * (knots[n - 1] - knots[0]);
    if (!(value >= knots[0] - slack && value <= knots[n - 1] + slack)) {
        return 0;
    }
    *cell = 0;
    while (*cell + 2 < n && value >= knots[*cell + 1]) {
        ++*cell;
    }
    *step = value - knots[*cell];
    return 1;
}

static void no_point(FlightPoint *point) {
    for (int k = 0; k < N_COEFFICIENTS; k++) {
        point->coefficient[k] = NAN;
    }
    point->dynamic_pressure = point->speed_of_sound = NAN;
}

int flight_point(const FlightModel *m, const FlightCondition *condition, FlightPoint *point) {
    double sine_a, cosine_a, sine_b, cosine_b, temperature, step_m = 0.0, step_a = 0.0;
    size_t i = 0, j = 0;
    no_point(point);
    sine_cosine(condition->angle_of_attack, &sine_a, &cosine_a);
    sine_cosine(condition->sideslip_angle, &sine_b, &cosine_b);
    const double up = sine_a * cosine_b, starboard = -sine_b, cross = sqrt(up * up + starboard * starboard);
    const double incidence = angle_of(cross, cosine_a * cosine_b), mach = condition->mach_number;
    if (!atmosphere_at(&m->atmosphere, condition->altitude, &point->ambient_pressure, &temperature)
        || !find_cell(m->mach_knots, m->n_mach, mach, &i, &step_m)
        || !find_cell(m->incidence_knots, m->n_incidence, incidence, &j, &step_a)) {
        return 0;
    }
    point->leeward_cosine = cross > 0.0 ? up / cross : 1.0;
    point->leeward_sine = cross > 0.0 ? starboard / cross : 0.0;
    point->speed_of_sound = sqrt(HEAT_CAPACITY_RATIO * GAS_CONSTANT * temperature);
    point->dynamic_pressure = 0.5 * HEAT_CAPACITY_RATIO * point->ambient_pressure * mach * mach;
    point->cell = i * (m->n_incidence - 1) + j;
    double row = 1.0;
    for (int p = 0; p < 4; p++, row *= step_m) {
        double power = row;
        for (int q = 0; q < 4; q++, power *= step_a) {
            point->weight[4 * p + q] = power;
        }
    }
    const double *table = m->coefficient_table + point->cell * N_POWERS * N_RADIAL;
    double radial[N_RADIAL] = {0.0, 0.0, 0.0};
    for (int k = 0; k < N_POWERS; k++) {
        for (int c = 0; c < N_RADIAL; c++) {
            radial[c] += point->weight[k] * table[k * N_RADIAL + c];
        }
    }
    const double inside = m->vented ? point->ambient_pressure : m->internal_pressure;
    point->coefficient[0] = radial[0] - inside * m->base_area / (point->dynamic_pressure * m->reference_area);
    point->coefficient[1] = radial[1] * point->leeward_cosine;
    point->coefficient[2] = radial[1] * point->leeward_sine;
    point->coefficient[3] = radial[2] * point->leeward_cosine;
    point->coefficient[4] = radial[2] * point->leeward_sine;
    return 1;
}

void flight_strains(const FlightModel *m, const FlightPoint *point, double *work, double *strain) {
    const size_t width = flight_model_work(m);
    const double *table = m->strain_table + point->cell * N_POWERS * width;
    for (size_t c = 0; c < width; c++) {
        work[c] = 0.0;
    }
    for (int k = 0; k < N_POWERS; k++, table += width) {
        for (size_t c = 0; c < width; c++) {
            work[c] += point->weight[k] * table[c];
        }
    }
    const double inside = m->vented ? point->ambient_pressure : m->internal_pressure;
    for (size_t g = 0; g < m->n_gauges; g++) {
        /* The angle from the leeward meridian, and its multiples by rotation. */
        const double c1 = m->gauge_cosine[g] * point->leeward_cosine + m->gauge_sine[g] * point->leeward_sine;
        const double s1 = m->gauge_sine[g] * point->leeward_cosine - m->gauge_cosine[g] * point->leeward_sine;
        const double *harmonic = work + (size_t)m->gauge_channel[g] * m->n_harmonic * 2;
        double cosine = 1.0, sine = 0.0, sum = 0.0;
        for (size_t k = 0; k < m->n_harmonic; k++, harmonic += 2) {
            sum += harmonic[0] * cosine + harmonic[1] * sine;
            const double turned = cosine * c1 - sine * s1;
            sine = sine * c1 + cosine * s1;
            cosine = turned;
        }
        const double of_body = point->ambient_pressure * sum - inside * m->strain_of_internal_pressure[g];
        strain[g] = of_body + m->apparent_strain[g];
    }
}
