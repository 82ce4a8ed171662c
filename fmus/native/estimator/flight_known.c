#include "flight_known.h"

#include <math.h>
#include <stdio.h>

#include "estimator.h"

#define N_KNOWN_SIZES 8
#define MAX_PARAMETERS 64
#define MAX_POWER 3

enum { N_PARAMETERS, N_POWERS, N_CHANNELS, N_TERMS, N_FURTHER_ROWS, N_FURTHER_CHANNELS, N_FURTHER_TERMS };

static double *taken(double **doubles, size_t count) {
    double *array = *doubles;
    *doubles += count;
    return array;
}

/* Products of strain, of loads with strain, of loads, of further loads with strain; variances of further loads. */
static size_t product_size(const KnownMap *map, size_t n) {
    const size_t loads = N_LOADS, m = map->further.n_rows;
    return n * n + loads * n + loads * loads + m * n + m;
}

/* Of powers of a parameter, pairs of these; map->parameter is known. */
static size_t number_of_products(const KnownMap *map) {
    size_t count = 1 + map->n_parameters;
    for (size_t a = 0; a < map->n_powers; a++) {
        for (size_t b = a; b < map->n_powers; b++) {
            count += map->parameter[a] == map->parameter[b];
        }
    }
    return count;
}

/* But for the products. */
static size_t leading_doubles(const KnownMap *map) {
    const size_t more = map->further.n_rows > 0 ? table_doubles(&map->further) : 0;
    const size_t slopes = table_coefficients(&map->tables) + table_coefficients(&map->further);
    return 1 + 2 * map->n_parameters + 3 * map->n_powers + map->n_powers * slopes + table_doubles(&map->tables) + more;
}

static void take_values(KnownMap *map, const double **next) {
    map->largest_score = *take_doubles(next, 1);
    map->mean = take_doubles(next, map->n_parameters);
    map->spread = take_doubles(next, map->n_parameters);
    map->parameter = take_doubles(next, map->n_powers);
    map->power = take_doubles(next, map->n_powers);
    map->offset = take_doubles(next, map->n_powers);
    map->slope = take_doubles(next, map->n_powers * table_coefficients(&map->tables));
    take_tables(&map->tables, next);
    map->further_slope = take_doubles(next, map->n_powers * table_coefficients(&map->further));
    if (map->further.n_rows > 0) {
        take_tables(&map->further, next);
    }
    map->product = *next;
}

static int sensible_powers(const KnownMap *map) {
    int good = map->largest_score >= 0.0;
    for (size_t p = 0; p < map->n_parameters; p++) {
        good = good && map->spread[p] >= 0.0;
    }
    for (size_t j = 0; j < map->n_powers; j++) {
        const double parameter = map->parameter[j], power = map->power[j];
        good = good && parameter >= (j > 0 ? map->parameter[j - 1] : 0.0) && parameter < (double)map->n_parameters
            && parameter == (double)(size_t)parameter && (power == 1.0 || power == 2.0 || power == MAX_POWER);
    }
    return good;
}

static int all_finite(const double *values, size_t count) {
    int good = 1;
    for (size_t i = 0; i < count; i++) {
        good = good && isfinite(values[i]);
    }
    return good;
}

/* From the sizes on; 0 where they cannot be. */
static int take_sizes(const Section *section, const FlightMap *flight, size_t n_further, KnownMap *map) {
    uint32_t size[N_KNOWN_SIZES] = {0};
    if (section->length < sizeof size) {
        return 0;
    }
    for (size_t k = 0; k < N_KNOWN_SIZES; k++) {
        size[k] = u32_at(section->content, 4 * k);
    }
    map->n_parameters = size[N_PARAMETERS];
    map->n_powers = size[N_POWERS];
    map->tables = map->further = flight->tables;
    map->tables.n_channels = size[N_CHANNELS];
    map->tables.n_terms = size[N_TERMS];
    map->further.n_rows = n_further;
    map->further.n_channels = size[N_FURTHER_CHANNELS];
    map->further.n_terms = size[N_FURTHER_TERMS];
    const int no_further = n_further == 0 && map->further.n_channels == 0 && map->further.n_terms == 0;
    return map->n_parameters >= 1 && map->n_parameters <= MAX_PARAMETERS
        && map->n_powers <= MAX_POWER * map->n_parameters && sensible_table_sizes(&map->tables)
        && size[N_FURTHER_ROWS] == n_further && (no_further || sensible_table_sizes(&map->further));
}

int known_map_parse(const Section *section, const FlightMap *flight, size_t n_gauges, size_t n_further, KnownMap *map,
                    char text[MODEL_TEXT_SIZE]) {
    const size_t values_at = 4 * N_KNOWN_SIZES;
    if (!take_sizes(section, flight, n_further, map) || section->length < values_at + 8 * leading_doubles(map)) {
        snprintf(text, MODEL_TEXT_SIZE, "holds tables of known parameters whose sizes cannot be");
        return 0;
    }
    const double *values = (const double *)(const void *)(section->content + values_at), *next = values;
    take_values(map, &next);
    const size_t count = leading_doubles(map) + number_of_products(map) * product_size(map, n_gauges);
    if (section->length != values_at + 8 * count) {
        snprintf(text, MODEL_TEXT_SIZE, "holds tables of known parameters whose sizes cannot be");
        return 0;
    }
    if (!all_finite(values, count) || !sensible_powers(map) || !sensible_terms(&map->tables)
        || (n_further > 0 && !sensible_terms(&map->further))) {
        snprintf(text, MODEL_TEXT_SIZE, "holds tables of known parameters with a value that cannot be");
        return 0;
    }
    return 1;
}

static size_t cells_of(const TableMap *map) {
    return (map->n_mach + 2) * (map->n_incidence + 2);
}

/* Doubles of the tables, and of the parts that they are made of. */
static size_t made_doubles(const TableMap *tables, size_t n_powers) {
    return flight_tables_doubles(tables) + (1 + n_powers) * flight_cell_doubles(tables) + cells_of(tables);
}

size_t known_doubles(const KnownMap *map, size_t n_gauges) {
    const size_t n = in_lanes(n_gauges), m = map->further.n_rows;
    return made_doubles(&map->tables, map->n_powers) + (m > 0 ? made_doubles(&map->further, map->n_powers) : 0) + n * n
         + 3 * map->n_parameters + 2 * map->n_powers + product_size(map, n_gauges);
}

/* Tables, and the parts that their cells are made of. */
static void made_arrays(const TableMap *map, const double *slope, const Known *known, FlightTables *tables,
                        CellParts *parts, double **doubles) {
    const size_t size = flight_cell_doubles(map), n_powers = known->map.n_powers;
    flight_tables_arrays(map, tables, doubles);
    double *part = taken(doubles, (1 + n_powers) * size);
    flight_cells(map, map->table, part);
    for (size_t j = 0; j < n_powers; j++) {
        flight_cells(map, slope + j * table_coefficients(map), part + (1 + j) * size);
    }
    *parts = (CellParts){.n_weights = n_powers, .n_cells = cells_of(map), .part = part, .weight = known->shift};
    parts->made = taken(doubles, parts->n_cells);
    tables->parts = parts;
}

void known_arrays(Estimator *e, double **doubles) {
    Flight *flight = &e->flight;
    Known *known = &flight->known;
    const KnownMap *map = &known->map;
    const size_t n = flight->solver.n, n_gauges = e->map.n_gauges, loads = N_LOADS, m = map->further.n_rows;
    known->mean = (Errors){.tables = flight->solver.tables,
                           .further = flight->further.tables,
                           .scaled_covariance = flight->solver.scaled_covariance,
                           .load_strain_covariance = flight->map.load_strain_covariance,
                           .load_covariance = flight->map.load_covariance,
                           .further_strain_covariance = flight->further.map.strain_covariance,
                           .further_variance = flight->further.map.variance};
    Errors *own = &known->own;
    known->shift = taken(doubles, map->n_powers);
    made_arrays(&map->tables, map->slope, known, &own->tables, &known->parts, doubles);
    if (m > 0) {
        made_arrays(&map->further, map->further_slope, known, &own->further, &known->further_parts, doubles);
    }
    own->scaled_covariance = taken(doubles, n * n);
    known->value = taken(doubles, map->n_parameters);
    known->std = taken(doubles, map->n_parameters);
    known->weight = taken(doubles, map->n_parameters);
    known->along = taken(doubles, map->n_powers);
    known->products = taken(doubles, product_size(map, n_gauges));
    own->load_strain_covariance = known->products + n_gauges * n_gauges;
    own->load_covariance = own->load_strain_covariance + loads * n_gauges;
    own->further_strain_covariance = own->load_covariance + loads * loads;
    own->further_variance = own->further_strain_covariance + m * n_gauges;
    for (size_t p = 0; p < map->n_parameters; p++) {
        known->value[p] = known->std[p] = NAN;
    }
}

int parameter_known(const Estimator *e, size_t which) {
    const Known *known = &e->flight.known;
    const size_t first = first_parameter(e);
    if (!known->present) {
        return 0;
    }
    const double value = e->input[first + which], std = e->input[first_parameter_std(e) + which];
    return value != e->map.not_known && isfinite(value) && std >= 0.0 && isfinite(std)
        && parameter_score(&e->parameters, which, value) <= known->map.largest_score;
}

int any_parameter_known(const Estimator *e) {
    int any = 0;
    for (size_t k = 0; e->flight.known.present && k < e->parameters.count; k++) {
        any |= parameter_known(e, k);
    }
    return any;
}

/* Note what the inputs know; whether that is something else than before. */
static int note_values(const Estimator *e, Known *known) {
    const double *value = e->input + first_parameter(e), *std = e->input + first_parameter_std(e);
    int other = 0;
    for (size_t p = 0; p < known->map.n_parameters; p++) {
        const int is_known = parameter_known(e, p) && known->map.spread[p] > 0.0;
        const double now[2] = {is_known ? value[p] : NAN, is_known ? std[p] : NAN};
        other |= is_known ? now[0] != known->value[p] || now[1] != known->std[p] : !isnan(known->value[p]);
        known->value[p] = now[0];
        known->std[p] = now[1];
    }
    return other;
}

static double power_of(double z, double power) {
    double product = 1.0;
    for (int k = 1; k <= MAX_POWER; k++) {
        product *= (double)k <= power ? z : 1.0;
    }
    return product;
}

/* Weights of the stated values against the spread, the powers' expected change, and what the deviation leaves of it. */
static void weigh(Known *known) {
    const KnownMap *map = &known->map;
    for (size_t p = 0; p < map->n_parameters; p++) {
        const double variance = map->spread[p] * map->spread[p], std = known->std[p];
        known->weight[p] = isnan(std) ? 0.0 : variance / (variance + std * std);
    }
    for (size_t j = 0; j < map->n_powers; j++) {
        const size_t p = (size_t)map->parameter[j];
        const double weight = known->weight[p], power = map->power[j];
        if (isnan(known->value[p])) {
            known->shift[j] = known->along[j] = 0.0;
            continue;
        }
        const double middle = map->mean[p] + weight * (known->value[p] - map->mean[p]);
        const double z = (middle - map->mean[p]) / map->spread[p], pairs = 0.5 * power * (power - 1.0) * (1.0 - weight);
        const double lower = power > 2.0 ? power - 2.0 : 0.0;
        known->shift[j] = power_of(z, power) + pairs * power_of(z, lower) - map->offset[j];
        known->along[j] = power * power_of(z, power - 1.0) * sqrt(weight * (1.0 - weight));
    }
}

/* y += a x. */
static void add_times(size_t count, double a, const double *restrict x, double *restrict y) {
    for (size_t i = 0; i < count; i++) {
        y[i] += a * x[i];
    }
}

static void set_products(Known *known, size_t n_gauges, size_t n) {
    const KnownMap *map = &known->map;
    const size_t size = product_size(map, n_gauges);
    const double *product = map->product;
    memcpy(known->products, product, size * sizeof *product);
    for (size_t a = 0; a < map->n_powers; a++) {
        for (size_t b = a; b < map->n_powers && map->parameter[b] == map->parameter[a]; b++) {
            add_times(size, known->along[a] * known->along[b], product += size, known->products);
        }
    }
    for (size_t p = 0; p < map->n_parameters; p++) {
        const double left = 1.0 - known->weight[p];
        add_times(size, left * left, product += size, known->products);
    }
    for (size_t i = 0; i < n_gauges; i++) {
        memcpy(known->own.scaled_covariance + i * n, known->products + i * n_gauges, n_gauges * sizeof *product);
    }
}

static void use(Flight *flight, const Errors *errors) {
    flight->solver.tables = errors->tables;
    flight->solver.scaled_covariance = errors->scaled_covariance;
    flight->map.load_strain_covariance = errors->load_strain_covariance;
    flight->map.load_covariance = errors->load_covariance;
    flight->further.tables = errors->further;
    flight->further.map.strain_covariance = errors->further_strain_covariance;
    flight->further.map.variance = errors->further_variance;
    flight->solver.response.known = flight->further.response.known = 0;
    flight->known.in_use = errors == &flight->known.own;
}

void known_follow(Estimator *e) {
    Flight *flight = &e->flight;
    Known *known = &flight->known;
    if (!any_parameter_known(e)) {
        known_forget(e);
        return;
    }
    const int other = note_values(e, known);
    if (other) {
        weigh(known);
        known->parts.round = known->further_parts.round = known->parts.round + 1.0;
        set_products(known, e->map.n_gauges, flight->solver.n);
    }
    if (other || !known->in_use) {
        use(flight, &known->own);
    }
}

void known_forget(Estimator *e) {
    if (e->flight.known.in_use) {
        use(&e->flight, &e->flight.known.mean);
    }
}
