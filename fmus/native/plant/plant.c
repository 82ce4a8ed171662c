/* The plant: the vehicle's strains, with noise and gauge faults, and its true coefficients.

   Its flight condition comes from inputs, from a trajectory, or, angle of attack and pitch rate, from the short-period
   motion that the aerodynamic and a control moment drive. */

#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include "../core/atmosphere.h"
#include "../core/elementary.h"
#include "../system/system_model.h"

/* The flight model: strain and coefficients of a vehicle of revolution over its envelope: strainfmu/cosim/models/flight_model.py in C. */

#define N_SIZES 11
#define N_POWERS 16
#define N_RADIAL 3 /* coefficients that incidence and Mach number alone decide: C_A, C_T, M_T */
#define MOST_OF_A_SIZE 65536.0
#define ROUND_OFF 1e-9 /* fraction of the envelope that is no departure from it */

static const double GAS_CONSTANT = 287.053, HEAT_CAPACITY_RATIO = 1.4;

#define N_COEFFICIENTS 5 /* C_A, C_N, C_Y, M_P, M_Y */

typedef struct {
    size_t n_gauges, n_mach, n_incidence, n_channel, n_harmonic;
    int vented;                                          /* 1: the inside is at the ambient pressure */
    double internal_pressure, base_area;                 /* [Pa], [m2] */
    double reference_area, reference_length;             /* [m2], [m] */
    const double *mach_knots, *incidence_knots;          /* [1], [rad] */
    const double *gauge_cosine, *gauge_sine;             /* (n_gauges) of the roll angles */
    const double *gauge_channel;                         /* (n_gauges) indices in strain_table */
    const double *strain_of_internal_pressure;           /* (n_gauges) [1/Pa] */
    const double *apparent_strain;                       /* (n_gauges) [1] */
    const double *noise_scale;                           /* (n_gauges) noise of a row over the noise of a gauge */
    const double *coefficient_table, *strain_table;      /* as in flight_model.py, row by row */
    Atmosphere atmosphere;
} FlightModel;

typedef struct {
    double mach_number, angle_of_attack, sideslip_angle, altitude; /* [1], [rad], [rad], [m] */
} FlightCondition;

/* What a condition gives before strains are computed. */
typedef struct {
    double coefficient[N_COEFFICIENTS];
    double dynamic_pressure, speed_of_sound, ambient_pressure; /* [Pa], [m/s], [Pa] */
    double leeward_cosine, leeward_sine;                       /* of the roll angle of the leeward meridian */
    size_t cell;                                               /* of the tables */
    double weight[16];
} FlightPoint;

static const double *take(const double **next, size_t count) {
    const double *array = *next;
    *next += count;
    return array;
}

/* Whether a number is one that things can be counted with. */
static int countable(double value, double minimum) {
    return value >= minimum && value <= MOST_OF_A_SIZE && value == (double)(size_t)value;
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

/* Take a model from doubles that begin with its sizes; the number taken, 0 if they do not fit into count. */
static size_t flight_model_take(FlightModel *m, const double *data, size_t count) {
    static const double MINIMUM[] = {1.0, 2.0, 2.0, 1.0, 1.0, 1.0};
    if (count < N_SIZES) {
        return 0;
    }
    for (int k = 0; k < 6; k++) {
        if (!countable(data[k], MINIMUM[k])) {
            return 0;
        }
    }
    size_t *const sizes[] = {&m->n_gauges, &m->n_mach, &m->n_incidence, &m->n_channel, &m->n_harmonic, &m->atmosphere.n_layers};
    for (int k = 0; k < 6; k++) {
        *sizes[k] = (size_t)data[k];
    }
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
    const double **const of_gauges[] = {&m->gauge_cosine, &m->gauge_sine, &m->gauge_channel, &m->strain_of_internal_pressure,
                                        &m->apparent_strain, &m->noise_scale};
    for (int k = 0; k < 6; k++) {
        *of_gauges[k] = take(&next, m->n_gauges);
    }
    m->coefficient_table = take(&next, table * N_RADIAL);
    m->strain_table = take(&next, table * m->n_channel * m->n_harmonic * 2);
    m->atmosphere.layer = take(&next, m->atmosphere.n_layers * LAYER_SIZE);
    return channels_exist(m) ? number_of_doubles(m) : 0;
}

/* Number of doubles of workspace that flight_strains needs. */
static size_t flight_model_work(const FlightModel *m) {
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

/* 1, or 0 outside the envelope, where the point is NaN. */
static int flight_point(const FlightModel *m, const FlightCondition *condition, FlightPoint *point) {
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

/* Strains (n_gauges) [1] without noise. */
static void flight_strains(const FlightModel *m, const FlightPoint *point, double *work, double *strain) {
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

/* Gauge noise: a standard normal number for every seed, sample and gauge, the same on every platform.
   strainfmu/cosim/models/gauge_noise.py holds the same in numpy, and the table. */
#define NOISE_OCTAVES 53
#define NOISE_COEFFICIENTS 10
#define NOISE_TABLE_SIZE (NOISE_OCTAVES * NOISE_COEFFICIENTS)

/* The finalizer of SplitMix64 (Steele, Lea & Flood, OOPSLA 2014). */
static uint64_t mixed(uint64_t x) {
    x = (x ^ (x >> 30)) * UINT64_C(0xBF58476D1CE4E5B9);
    x = (x ^ (x >> 27)) * UINT64_C(0x94D049BB133111EB);
    return x ^ (x >> 31);
}

static double gauge_noise(const double *table, uint64_t seed, uint64_t sample, uint64_t gauge) {
    const uint64_t step = UINT64_C(0x9E3779B97F4A7C15);
    const uint64_t bits = mixed(mixed(mixed(seed + step) + sample * step + step) + gauge * step + step);
    /* A probability from 2^-54 to below 1/2: its octave and where it lies in there choose the quantile. */
    const double probability = ((double)(bits >> 12) + 0.5) * (1.0 / 9007199254740992.0);
    uint64_t pattern;
    memcpy(&pattern, &probability, sizeof pattern);
    const size_t octave = (size_t)(1021 - (pattern >> 52));
    pattern = (pattern & UINT64_C(0x000FFFFFFFFFFFFF)) | UINT64_C(0x3FF0000000000000);
    double fraction;
    memcpy(&fraction, &pattern, sizeof fraction); /* 1 <= fraction < 2 */
    const double argument = 2.0 * fraction - 3.0, *coefficient = table + octave * NOISE_COEFFICIENTS;
    double quantile = coefficient[NOISE_COEFFICIENTS - 1];
    for (int k = NOISE_COEFFICIENTS - 2; k >= 0; k--) {
        quantile = quantile * argument + coefficient[k];
    }
    return bits & 1u ? -quantile : quantile;
}

enum { FROM_INPUTS, FROM_TRAJECTORY, SHORT_PERIOD };
enum { NO_FAULT, DROPOUT, BIAS, DRIFT, STUCK, FROZEN };

/* Indices of the variables after the coefficients and strains, then, after one fault_kind and one fault_value per
   gauge, the variables of the short-period motion. */
enum { DYNAMIC_PRESSURE, MACH_NUMBER, ANGLE_OF_ATTACK, SIDESLIP_ANGLE, ALTITUDE, NOISE_STD, SEED, N_COMMON };
enum { PITCH_RATE, CONTROL_MOMENT, MASS, PITCH_INERTIA, PITCH_DAMPING, INITIAL_ANGLE, N_SHORT_PERIOD };

/* States before the four of each gauge: kind and onset of its fault, its last reading, and the reading it holds. */
enum { SAMPLE, ANGLE, RATE, N_OWN_STATES };
#define STATES_PER_GAUGE 4

#define ROW_SIZE 9           /* of the trajectory: time, four quantities, their slopes */
#define MAX_SUBSTEP 1e-3 /* [s] of the integration */
#define MAX_STEPS 1e6

typedef struct {
    FlightModel flight;
    int motion;
    const double *noise_table, *row;
    size_t n_rows;
    const double *common, *fault_kind, *fault_value, *own; /* variables */
    double *strain, *output;                               /* variables */
    double *gauge_state;
} Plant;

/* Where everything lies; 0 if the data do not fit. */
static int view(const SystemModel *model, Plant *plant) {
    const size_t head = 2 + NOISE_TABLE_SIZE;
    if (model->n_data < head) {
        return 0;
    }
    const double *data = model->data;
    const size_t used = flight_model_take(&plant->flight, data + head, model->n_data - head);
    const size_t rest = model->n_data - head - used, n = plant->flight.n_gauges;
    if (used == 0 || data[0] < (double)FROM_INPUTS || data[0] > (double)SHORT_PERIOD || data[1] < 0.0 || data[1] > 1e6) {
        return 0;
    }
    plant->motion = (int)data[0];
    plant->n_rows = (size_t)data[1];
    plant->noise_table = data + 2;
    plant->row = data + head + used;
    const size_t variables = N_COEFFICIENTS + 3 * n + N_COMMON + (plant->motion == SHORT_PERIOD ? N_SHORT_PERIOD : 0);
    if (rest != plant->n_rows * ROW_SIZE || (plant->motion == FROM_TRAJECTORY && plant->n_rows < 2)
        || model->n_variables != variables) {
        return 0;
    }
    if (model->value != NULL) {
        plant->output = model->value;
        plant->strain = model->value + N_COEFFICIENTS;
        plant->common = plant->strain + n;
        plant->fault_kind = plant->common + N_COMMON;
        plant->fault_value = plant->fault_kind + n;
        plant->own = plant->fault_value + n;
        plant->gauge_state = model->state + N_OWN_STATES;
    }
    return 1;
}

static int prepare(SystemModel *model, char text[MODEL_TEXT_SIZE]) {
    Plant plant;
    if (!view(model, &plant)) {
        snprintf(text, MODEL_TEXT_SIZE, "holds a plant whose sizes do not fit each other");
        return STATUS_ERROR;
    }
    model->n_states = N_OWN_STATES + STATES_PER_GAUGE * plant.flight.n_gauges;
    model->n_work = flight_model_work(&plant.flight);
    return STATUS_OK;
}

static void begin(SystemModel *model) {
    Plant plant;
    view(model, &plant);
    memset(model->state, 0, model->n_states * sizeof *model->state);
    if (plant.motion == SHORT_PERIOD) {
        model->state[ANGLE] = plant.own[INITIAL_ANGLE];
    }
}

/* The trajectory at a time: strainfmu/cosim/models/trajectory.py. */
static FlightCondition on_trajectory(const Plant *plant, double time) {
    const double stop = plant->row[(plant->n_rows - 1) * ROW_SIZE];
    const double t = time < 0.0 ? 0.0 : time > stop ? stop : time;
    size_t i = 0;
    while (i + 2 < plant->n_rows && t >= plant->row[(i + 1) * ROW_SIZE]) {
        i++;
    }
    const double *a = plant->row + i * ROW_SIZE, *b = a + ROW_SIZE;
    const double width = b[0] - a[0], s = (t - a[0]) / width;
    double value[4];
    for (int k = 0; k < 4; k++) {
        const double rise = b[1 + k] - a[1 + k];
        value[k] = a[1 + k]
                 + s * (width * a[5 + k] * ((1.0 - s) * (1.0 - s)) + rise * s * (3.0 - 2.0 * s)
                        - width * b[5 + k] * s * (1.0 - s));
    }
    return (FlightCondition){value[0], value[1], value[2], value[3]};
}

static FlightCondition condition_of(const SystemModel *model, const Plant *plant) {
    if (plant->motion == FROM_TRAJECTORY) {
        return on_trajectory(plant, model->base.time);
    }
    const double angle = plant->motion == SHORT_PERIOD ? model->state[ANGLE] : plant->common[ANGLE_OF_ATTACK];
    return (FlightCondition){plant->common[MACH_NUMBER], angle, plant->common[SIDESLIP_ANGLE], plant->common[ALTITUDE]};
}

/* What a gauge reads. `own` holds its four states; a fault begins when it is first seen here. */
static double reading(double *own, double healthy, double kind, double value, double time) {
    if (kind != own[0]) {
        own[0] = kind;
        own[1] = time;
        own[3] = own[2];
    }
    switch ((int)kind) {
    case DROPOUT: return NAN;
    case BIAS: return healthy + value;
    case DRIFT: return healthy + value * (time - own[1]);
    case STUCK: return value;
    case FROZEN: return own[3];
    default: return healthy;
    }
}

/* A count that a damaged state cannot turn into something undefined. */
static uint64_t whole(double count) {
    return count >= 0.0 && count < 9e15 ? (uint64_t)count : 0;
}

static void outputs(SystemModel *model) {
    Plant plant;
    FlightPoint point;
    view(model, &plant);
    const FlightCondition condition = condition_of(model, &plant);
    const int inside = flight_point(&plant.flight, &condition, &point);
    const size_t n = plant.flight.n_gauges;
    memcpy(plant.output, point.coefficient, sizeof point.coefficient);
    if (inside) {
        flight_strains(&plant.flight, &point, model->work, plant.strain);
    }
    const uint64_t seed = (uint64_t)plant.common[SEED], sample = whole(model->state[SAMPLE]);
    for (size_t g = 0; g < n; g++) {
        const double noise = plant.common[NOISE_STD] * gauge_noise(plant.noise_table, seed, sample, g)
                           * plant.flight.noise_scale[g];
        const double healthy = inside ? plant.strain[g] + noise : NAN;
        plant.strain[g] = reading(plant.gauge_state + STATES_PER_GAUGE * g, healthy, plant.fault_kind[g],
                                  plant.fault_value[g], model->base.time);
    }
    double *common = plant.strain + n;
    common[DYNAMIC_PRESSURE] = point.dynamic_pressure;
    common[ANGLE_OF_ATTACK] = condition.angle_of_attack;
    if (plant.motion == FROM_TRAJECTORY) {
        common[MACH_NUMBER] = condition.mach_number;
        common[SIDESLIP_ANGLE] = condition.sideslip_angle;
        common[ALTITUDE] = condition.altitude;
    }
    if (plant.motion == SHORT_PERIOD) {
        common[N_COMMON + 2 * n + PITCH_RATE] = model->state[RATE];
    }
}

/* Rates of angle of attack and pitch rate; 0 outside the envelope. */
static int motion_rates(const Plant *plant, const double angle_and_rate[2], double rates[2]) {
    const FlightModel *flight = &plant->flight;
    const FlightCondition condition = {plant->common[MACH_NUMBER], angle_and_rate[0], plant->common[SIDESLIP_ANGLE],
                                       plant->common[ALTITUDE]};
    FlightPoint point;
    if (!flight_point(flight, &condition, &point)) {
        return 0;
    }
    const double speed = condition.mach_number * point.speed_of_sound, rate = angle_and_rate[1];
    const double force_scale = point.dynamic_pressure * flight->reference_area;
    const double damping = plant->own[PITCH_DAMPING] * rate * flight->reference_length / (2.0 * speed);
    rates[0] = rate - force_scale * point.coefficient[1] / (plant->own[MASS] * speed);
    rates[1] = (force_scale * flight->reference_length * (point.coefficient[3] + damping) + plant->own[CONTROL_MOMENT])
             / plant->own[PITCH_INERTIA];
    return 1;
}

/* One step of the classical Runge-Kutta method of fourth order. Where it leaves the envelope the state becomes the
   first one outside, so that the outputs show it. */
static int integrate(const Plant *plant, double *state, double h) {
    static const double PART[] = {0.0, 0.5, 0.5, 1.0}, WEIGHT[] = {1.0, 2.0, 2.0, 1.0};
    double rates[2] = {0.0, 0.0}, sum[2] = {0.0, 0.0};
    for (int k = 0; k < 4; k++) {
        const double at[2] = {state[0] + PART[k] * h * rates[0], state[1] + PART[k] * h * rates[1]};
        if (!motion_rates(plant, at, rates)) {
            memcpy(state, at, sizeof at);
            return 0;
        }
        sum[0] += WEIGHT[k] * rates[0];
        sum[1] += WEIGHT[k] * rates[1];
    }
    state[0] += h / 6.0 * sum[0];
    state[1] += h / 6.0 * sum[1];
    return 1;
}

static int move(const Plant *plant, double *state, double width) {
    const double required = width / MAX_SUBSTEP * (1.0 - 1e-9);
    const double steps = required > MAX_STEPS ? MAX_STEPS : (double)(long)required + 1.0;
    for (double k = 0.0; k < steps; k += 1.0) {
        if (!integrate(plant, state, width / steps)) {
            return 0;
        }
    }
    return 1;
}

static int step(SystemModel *model, double end, char text[MODEL_TEXT_SIZE]) {
    Plant plant;
    view(model, &plant);
    for (size_t g = 0; g < plant.flight.n_gauges; g++) {
        plant.gauge_state[STATES_PER_GAUGE * g + 2] = plant.strain[g];
    }
    int inside = plant.motion != SHORT_PERIOD || move(&plant, model->state + ANGLE, end - model->base.time);
    model->base.time = end;
    model->state[SAMPLE] += 1.0;
    FlightPoint point;
    const FlightCondition condition = condition_of(model, &plant);
    inside = inside && flight_point(&plant.flight, &condition, &point);
    if (!inside) {
        snprintf(text, MODEL_TEXT_SIZE,
                 "the flight condition at %g s is outside the envelope of the flight model: Mach number %g, angle of "
                 "attack %g rad, sideslip %g rad, altitude %g m",
                 end, condition.mach_number, condition.angle_of_attack, condition.sideslip_angle, condition.altitude);
        return STATUS_DISCARD;
    }
    return STATUS_OK;
}

const Behaviour PLANT = {prepare, begin, outputs, step};
