/* Temperature and inertia at run time: strain of the modes, subtracted from the readings as far as sensors measure
   it.

   k modes with amplitudes a of prior standard deviations s; n_t sensors theta = C a + e with e of standard
   deviations r; n gauges that are B a warmer and have the strain Phi a. A reading with slopes g of the gauge factor
   and m of the modulus and the polynomial p of the data sheet is

       d = (1 + g Ba) (eps / (1 + m Ba) + Phi a + p(Ba)),      so that     eps = factor d - offset,
       factor = (1 + m Ba) / (1 + g Ba),      offset = (Phi a + p(Ba)) (1 + m Ba).

   Known sensors give a by conditioning. With whitened amplitudes A = R^-1/2 C diag(s) of the known sensors, 0 of
   others,

       1 + A' A = L L',      left = diag(s) L'^-1,      P = left left',      a = left L^-1 A' R^-1/2 theta.

   What they leave, F P F' with F = Phi + p_1 B, stays in the covariance of the gauges: own = isothermal + F P F',
   and noise = own + scaled with the errors that scale. These change only when a sensor comes or goes; a new reading
   costs the product of `gain` (2 n, n_t), strain and rise of each gauge per rise of each sensor. No sensor known:
   the map's own matrices, in which the modes are noise, and no correction.

   Inertia uses the same machine: its modes are amplitudes of channels of an inertial unit (sample/inputs.c), the
   last sensors. The standard deviation of vibration modes is an input, in steps of sqrt 2 over its prior, so that
   matrices stay while it changes little. docs/explanation/temperature.md, "The model";
   strainfmu/estimator/map/sensors.py; amplitudes and rows_of in strainfmu/estimator/reference/readings.py. */

#include "thermal.h"

#include <math.h>
#include <stdlib.h>

#define ROOT_2 0x1.6a09e667f3bcdp+0
#define LEAST_VIBRATION 0.0625 /* over prior_std; less counts as none */
#define MOST_VIBRATION 1024.0
#define NO_VIBRATION 1e-6
#define LARGEST_CHANNEL 1e6 /* of what an inertial unit measures: one beyond is broken */
#define OTHER_FORCES 0.5     /* of the larger force: a fin or a jet may differ by it from the specific force of the mass */

static int parse(MapFile *file, ThermalMap *map) {
    MAP_READ(file, "thermal", THERMAL, ThermalMap, map);
    if (map_has(file, "inertia")) {
        MAP_READ(file, "inertia", INERTIA, ThermalMap, map);
    }
    map_require(file, map->n_vibrations <= map->n_modes, "inertia.vibrations", "at most the number of modes");
    map_require(file, map->n_channels <= map->n_sensors, "inertia.channels", "at most the number of sensors");
    if (map->n_channels > 0 && map_has(file, "vehicle")) {
        MAP_READ(file, "vehicle", VEHICLE, ThermalMap, map);
    }
    return file->good;
}

static void lay_out(void *part, Room *room) {
    Thermal *thermal = part;
    const size_t n = thermal->n_gauges, k = thermal->map.n_modes, m = thermal->map.n_sensors;
    const size_t rows = dense_rows(2 * n), columns = dense_columns(m);
    /* A, left, L and its inverse, strain by whitened amplitudes, then gains before they are laid out in panels. */
    const size_t scratch = m * k + k * k + k * (k + 1) + n * k + 2 * n * m + columns + ROWS;
    thermal->gain = taken(room, rows * columns);
    TAKE(room, n * n, &thermal->own, &thermal->noise);
    thermal->rise = taken(room, columns);
    thermal->of_gauge = taken(room, rows);
    TAKE(room, n, &thermal->factor, &thermal->offset);
    thermal->information = taken(room, k * k);
    thermal->amplitude = taken(room, k * m);
    thermal->scratch = taken(room, scratch);
    thermal->known = piece(room, m, 1);
}

int thermal_create(MapFile *file, size_t n_gauges, int wide, Thermal *thermal) {
    ThermalMap *map = &thermal->map;
    if (!map_has(file, "thermal")) {
        return file->good;
    }
    if (!parse(file, map)) {
        return 0;
    }
    thermal->n_gauges = n_gauges;
    if (!map_hand_out(file, lay_out, thermal)) {
        return 0;
    }
    thermal->present = 1;
    thermal->vibration = 1.0;
    thermal->wide = wide;
    thermal_renew(thermal);
    return 1;
}

/* The next larger power of the root of 2, so that matrices stay while the vibration changes little. */
static double step_above(double ratio) {
    double step = LEAST_VIBRATION;
    if (ratio <= LEAST_VIBRATION) {
        return NO_VIBRATION;
    }
    while (step < ratio && step < MOST_VIBRATION) {
        step = step * ROOT_2 >= ratio ? step * ROOT_2 : 2.0 * step;
    }
    return step;
}

int thermal_set_vibration(Thermal *thermal, double vibration) {
    const int known = vibration > 0.0;
    const double step = known ? vibration : 1.0;
    const int changed = known != thermal->knows_vibration || step != thermal->vibration;
    thermal->knows_vibration = known;
    thermal->vibration = step;
    return changed;
}

int thermal_is_vibration(double vibration) {
    return vibration == 0.0 || (vibration >= NO_VIBRATION && vibration <= 2.0 * MOST_VIBRATION);
}

/* Whether the matrices are for another vibration than this one [1]. */
static int read_vibration(Thermal *thermal, double vibration) {
    const ThermalMap *map = &thermal->map;
    const int known = map->n_vibrations > 0 && vibration >= 0.0;
    return thermal_set_vibration(thermal, known ? step_above(vibration / map->prior_std[map->n_modes - 1]) : 0.0);
}

int thermal_vibrates(const Thermal *thermal) {
    return thermal->knows_vibration && thermal->vibration > 1.0;
}

/* Lateral force against mass times specific force: |F - m a| above half of the larger one, as fins and jets may
   differ by that much, and above the limit in standard deviations. */
int thermal_contradicted(const Thermal *thermal, const double *loads, const double *loads_std, double limit) {
    const ThermalMap *map = &thermal->map;
    for (int axis = 1; axis <= 2 && thermal->present && map->vehicle_mass > 0.0; axis++) {
        const size_t force = 3 - (size_t)axis, sensor = map->n_sensors - map->n_channels + (size_t)axis;
        const double expected = map->vehicle_mass * thermal->rise[sensor], off = fabs(loads[force] - expected);
        const double std = map->vehicle_mass * map->sensor_std[sensor];
        const double variance = std * std + loads_std[force] * loads_std[force];
        const double others = OTHER_FORCES * fmax(fabs(loads[force]), fabs(expected));
        if (thermal->known[sensor] && off > others && off * off > limit * variance) {
            return axis;
        }
    }
    return 0;
}

int thermal_read(Thermal *thermal, const double *temperature, const double *channel, double vibration) {
    const ThermalMap *map = &thermal->map;
    const size_t n_temperatures = map->n_sensors - map->n_channels;
    int changed = read_vibration(thermal, vibration), moved = 0;
    for (size_t t = 0; t < map->n_sensors; t++) {
        const int is_channel = t >= n_temperatures;
        const double above = is_channel ? channel[t - n_temperatures] : temperature[t] - map->reference_temperature;
        const unsigned char known = is_channel ? fabs(above) <= LARGEST_CHANNEL /* 0 for NaN */
                                               : temperature[t] > 0.0 && fabs(above) <= map->largest_rise;
        const double rise = known ? above : 0.0;
        changed |= known != thermal->known[t];
        moved |= rise != thermal->rise[t];
        thermal->known[t] = known;
        thermal->rise[t] = rise;
    }
    thermal->outdated |= changed | moved;
    return changed;
}

/* The standard deviation of a mode without sensors: of vibration it follows what is known of that. */
static double prior_of(const Thermal *thermal, size_t mode) {
    const ThermalMap *map = &thermal->map;
    return map->prior_std[mode] * (mode >= map->n_modes - map->n_vibrations ? thermal->vibration : 1.0);
}

/* a per rise of the known sensors (n_modes, n_sensors), and left (n_modes, n_modes). */
static void set_amplitudes(Thermal *thermal, double *seen, double *left, double *root, double *amplitude) {
    const ThermalMap *map = &thermal->map;
    const size_t k = map->n_modes, n_t = map->n_sensors;
    double *inverse = root + k * (k + 1) / 2, *information = thermal->information;
    for (size_t t = 0; t < n_t; t++) {
        for (size_t a = 0; a < k; a++) {
            const double size = map->sensor_operator[t * k + a] * prior_of(thermal, a) / map->sensor_std[t];
            seen[t * k + a] = thermal->known[t] ? size : 0.0;
        }
    }
    for (size_t a = 0; a < k; a++) {
        for (size_t b = 0; b <= a; b++) {
            double sum = a == b ? 1.0 : 0.0;
            for (size_t t = 0; t < n_t; t++) {
                sum += seen[t * k + a] * seen[t * k + b];
            }
            information[a * k + b] = information[b * k + a] = sum;
        }
    }
    lower_root(k, information, root, inverse); /* of 1 and a sum of squares: always one */
    for (size_t t = 0; t < n_t; t++) { /* L^-1 A' instead of A */
        double *row = seen + t * k;
        for (size_t a = k; a-- > 0;) {
            row[a] = dot(a + 1, inverse + triangle_column(a), row);
        }
    }
    for (size_t a = 0; a < k; a++) {
        for (size_t b = 0; b < k; b++) {
            left[a * k + b] = b < a ? 0.0 : prior_of(thermal, a) * inverse[triangle_column(b) + a];
        }
        for (size_t t = 0; t < n_t; t++) {
            amplitude[a * n_t + t] = dot(k, left + a * k, seen + t * k) / map->sensor_std[t];
        }
    }
}

/* own = isothermal + F P F', noise = own + scaled, by the product of F left with itself. */
static void set_covariances(Thermal *thermal, const double *left, double *strain) {
    const ThermalMap *map = &thermal->map;
    const size_t k = map->n_modes, n = thermal->n_gauges;
    const double first = map->n_powers > 0 ? map->apparent_strain[0] : 0.0;
    for (size_t i = 0; i < n; i++) {
        for (size_t b = 0; b < k; b++) {
            double sum = 0.0;
            for (size_t a = 0; a < k; a++) {
                sum += (map->mode_strain[i * k + a] + first * map->gauge_operator[i * k + a]) * left[a * k + b];
            }
            strain[i * k + b] = sum;
        }
    }
    for (size_t i = 0; i < n; i++) {
        for (size_t j = 0; j <= i; j++) {
            const double of_modes = dot(k, strain + i * k, strain + j * k);
            thermal->own[i * n + j] = map->isothermal_covariance[i * n + j] + of_modes;
            thermal->own[j * n + i] = map->isothermal_covariance[j * n + i] + of_modes;
        }
    }
    for (size_t i = 0; i < n * n; i++) {
        thermal->noise[i] = thermal->own[i] + map->scaled_covariance[i];
    }
}

void thermal_renew(Thermal *thermal) {
    const ThermalMap *map = &thermal->map;
    const size_t k = map->n_modes, n_t = map->n_sensors, n = thermal->n_gauges;
    double *seen = thermal->scratch, *left = seen + n_t * k, *root = left + k * k;
    double *strain = root + k * (k + 1), *gain = strain + n * k, *amplitude = thermal->amplitude;
    thermal->some = thermal->knows_vibration;
    for (size_t t = 0; t < n_t; t++) {
        thermal->some |= thermal->known[t];
    }
    set_amplitudes(thermal, seen, left, root, amplitude);
    if (!thermal->some) {
        return;
    }
    set_covariances(thermal, left, strain);
    for (size_t i = 0; i < n; i++) {
        for (size_t t = 0; t < n_t; t++) {
            double of_strain = 0.0, of_rise = 0.0;
            for (size_t a = 0; a < k; a++) {
                of_strain += map->mode_strain[i * k + a] * amplitude[a * n_t + t];
                of_rise += map->gauge_operator[i * k + a] * amplitude[a * n_t + t];
            }
            gain[i * n_t + t] = of_strain;
            gain[(n + i) * n_t + t] = of_rise;
        }
    }
    dense_panels(2 * n, n_t, gain, n_t, 1, thermal->gain);
}

/* factor and offset of all gauges; the polynomial by Horner's scheme. */
EVERYWHERE void set_factors(size_t n, size_t n_powers, const double *restrict powers, double gauge_factor, double modulus,
                            const double *restrict strain, const double *restrict rise, double *restrict factor,
                            double *restrict offset) {
    for (size_t i = 0; i < n; i++) {
        offset[i] = 0.0;
    }
    for (size_t power = n_powers; power-- > 0;) {
        const double coefficient = powers[power];
        for (size_t i = 0; i < n; i++) {
            offset[i] = (offset[i] + coefficient) * rise[i];
        }
    }
    for (size_t i = 0; i < n; i++) {
        const double stiffness = 1.0 + modulus * rise[i];
        offset[i] = (strain[i] + offset[i]) * stiffness;
        factor[i] = stiffness / (1.0 + gauge_factor * rise[i]);
    }
}

FOR_AVX2(set_factors, (size_t n, size_t n_powers, const double *powers, double gauge_factor, double modulus,
          const double *strain, const double *rise, double *factor, double *offset),
         (n, n_powers, powers, gauge_factor, modulus, strain, rise, factor, offset))

static void follow(Thermal *thermal) {
    const ThermalMap *map = &thermal->map;
    const size_t n = thermal->n_gauges;
    if (!thermal->outdated) {
        return;
    }
    dense_times(thermal->wide, 2 * n, map->n_sensors, thermal->gain, thermal->rise, thermal->of_gauge);
    CHOSEN(thermal->wide, set_factors)(n, map->n_powers, map->apparent_strain, map->gauge_factor_slope,
                                       map->modulus_slope, thermal->of_gauge, thermal->of_gauge + n, thermal->factor,
                                       thermal->offset);
    thermal->outdated = 0;
}

void thermal_correct(Thermal *thermal, double *restrict strain) {
    if (!thermal->some) {
        return;
    }
    follow(thermal);
    const double *restrict factor = thermal->factor, *restrict offset = thermal->offset;
    for (size_t i = 0; i < thermal->n_gauges; i++) {
        strain[i] = strain[i] * factor[i] - offset[i];
    }
}
