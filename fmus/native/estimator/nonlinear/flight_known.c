/* Flow parameters, such as control deflections, that are known with a standard deviation: tables and errors about
   what is known.

   Without knowledge the tables are their mean over the snapshots, and the spread of the parameters is an error of
   strain and loads. Parameter z has mean m and standard deviation s over the snapshots. A stated value v with the
   standard deviation t is joined with this prior:

       weight k = s^2 / (s^2 + t^2),     mean m + k (v - m),     variance (1 - k) s^2.

   With z = (that mean - m) / s the tables change, per p_inf, by the sum over powers j (1 to 3) of shift_j times a
   table of the power,

       shift_j = E[z^j] - offset_j = z^j + j (j - 1) / 2 (1 - k) z^(j-2) - offset_j,

   the expectation of the power at the remaining variance 1 - k less its mean over the snapshots. Errors are products
   H H' of strain and loads, per p_inf^2: of what no parameter makes, plus along_a along_b times products of pairs of
   powers of a parameter, plus (1 - k)^2 times the products of the parameter's spread,

       along_j = j z^(j-1) sqrt(k (1 - k)),

   the slope of the power times an error of variance k (1 - k). The two parts k (1 - k), along the tables, and (1 -
   k)^2, of the spread, are the remaining variance 1 - k: with k = 0 the errors of the mean come back, with k = 1 the
   error of the parameter is gone. docs/explanation/nonlinear_estimator.md, "Any shape";
   strainfmu/estimator/map/nonlinear_map.py.

   Tables with parameters have two channels for each row, factors of cos m phi and of sin m phi: gauges that are
   rotations of each other no longer share one where a fin deflects. Their cells are sums of parts (flight_tables.c),
   made when a state needs them. */

#include "nonlinear.h"

#include <math.h>

#define LARGEST_POWER 3

/* Products of strain, of loads with strain, of loads, of other loads with strain; variances of other loads. */
static size_t known_product_size(const KnownMap *map, size_t n) {
    const size_t loads = N_LOADS, m = map->n_other;
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

/* Of each power, by ascending parameters, its parameter and exponent. */
static int sensible_powers(const KnownMap *map) {
    int good = 1;
    for (size_t j = 0; j < map->n_powers; j++) {
        const double parameter = map->parameter[j], power = map->power[j];
        good = good && parameter >= (j > 0 ? map->parameter[j - 1] : 0.0) && parameter < (double)map->n_parameters
            && parameter == (double)(size_t)parameter && (power == 1.0 || power == 2.0 || power == LARGEST_POWER);
    }
    return good;
}

int known_map_parse(MapFile *file, const FlightMap *flight, size_t n_gauges, size_t n_other, KnownMap *map) {
    map->n_other = n_other;
    map->n_rows = file->length[SYM_ROWS] = flight->tables.n_rows + n_other;
    file->length[SYM_HARMONICS] = flight->tables.n_harmonics;
    MAP_READ(file, "parameter_tables", PARAMETER_TABLES, KnownMap, map);
    if (!file->good
        || !map_require(file, sensible_powers(map), "parameter_tables.parameter",
                        "parameters of the map, ascending, and powers to 3")) {
        return 0;
    }
    file->length[SYM_PRODUCTS] = number_of_products(map);
    file->length[SYM_PRODUCT_SIZE] = known_product_size(map, n_gauges);
    MAP_READ(file, "parameter_tables", PRODUCTS, KnownMap, map);
    return file->good;
}

static size_t cells_of(const TableMap *map) {
    return (map->n_mach + 2) * (map->n_incidence + 2);
}

/* The mean's tables with two channels, and so two terms, for each row. */
static void lay_out(const TableMap *mean, MadeTables *made) {
    made->map = *mean;
    made->map.n_channels = made->map.n_terms = 2 * mean->n_rows;
    made->map.table = NULL;
}

void known_lay_out(const TableMap *mean, const TableMap *other_loads, Known *known) {
    lay_out(mean, &known->tables);
    lay_out(other_loads, &known->other_loads);
}

/* Term 2 r adds cos m phi of row r, term 2 r + 1 its sin m phi. */
static void set_terms(TableMap *map, Room *room) {
    const size_t terms = map->n_terms, m = map->n_harmonics;
    double *row = taken(room, terms), *channel = taken(room, terms);
    double *cosine = taken(room, terms * m), *sine = taken(room, terms * m);
    for (size_t t = 0; room->next != NULL && t < terms; t++) {
        row[t] = (double)(t / 2);
        channel[t] = (double)t;
        for (size_t k = 0; k < m; k++) {
            cosine[t * m + k] = t % 2 ? 0.0 : 1.0;
            sine[t * m + k] = t % 2 ? 1.0 : 0.0;
        }
    }
    map->row = row;
    map->channel = channel;
    map->cosine = cosine;
    map->sine = sine;
}

/* The part of the mean: channels of its tables with the factors of each row's terms. */
static void set_mean(const TableMap *mean, size_t harmonics, size_t width, double *part) {
    const size_t m = mean->n_harmonics;
    for (size_t cell = 0; cell < cells_of(mean); cell++) {
        for (size_t t = 0; t < mean->n_terms; t++) {
            const double *value = mean->table + (cell * mean->n_channels + (size_t)mean->channel[t]) * m;
            double *of_cosine = part + cell * width + 2 * (size_t)mean->row[t] * harmonics;
            for (size_t k = 0; k < m; k++) {
                of_cosine[k] += mean->cosine[t * m + k] * value[k];
                of_cosine[harmonics + k] += mean->sine[t * m + k] * value[k];
            }
        }
    }
}

/* The part of power j: each row a sum over the basis tables, weighted by Mach knot; rows from `first` of the section
   on. */
static void set_power(const KnownMap *map, const TableMap *tables, size_t first, size_t j, size_t harmonics, double *part) {
    const size_t n_angle = tables->n_incidence + 2, m = tables->n_harmonics, n_rows = tables->n_rows;
    for (size_t cell = 0; cell < cells_of(tables); cell++) {
        const double *rows = map->row_weight + ((cell / n_angle * map->n_powers + j) * map->n_rows + first) * map->n_basis;
        for (size_t r = 0; r < n_rows; r++) {
            double *of_cosine = part + (cell * n_rows + r) * 2 * harmonics, *of_sine = of_cosine + harmonics;
            for (size_t b = 0; b < map->n_basis; b++) {
                const double *basis = map->basis + (b * n_angle + cell % n_angle) * m * 2;
                const double weight = rows[r * map->n_basis + b];
                for (size_t k = 0; k < m; k++) {
                    of_cosine[k] += weight * basis[2 * k];
                    of_sine[k] += weight * basis[2 * k + 1];
                }
            }
        }
    }
}

/* Tables about the tables of the mean, whose rows are the section's from `first` on. */
static void made_arrays(const KnownMap *map, const TableMap *mean, size_t first, double *shift, MadeTables *made,
                        FlightTables *tables, Room *room) {
    const size_t size = flight_cell_doubles(&made->map);
    set_terms(&made->map, room);
    flight_tables_arrays(&made->map, tables, room);
    double *part = taken(room, (1 + map->n_powers) * size);
    made->parts = (CellParts){.n_weights = map->n_powers, .n_cells = cells_of(mean), .part = part, .weight = shift};
    made->parts.made = taken(room, made->parts.n_cells);
    tables->parts = &made->parts;
    if (room->next != NULL) {
        set_mean(mean, tables->harmonics, tables->width, part);
    }
    for (size_t j = 0; room->next != NULL && j < map->n_powers; j++) {
        set_power(map, &made->map, first, j, tables->harmonics, part + (1 + j) * size);
    }
}

void known_arrays(FlightMap *flight, FlightSolver *solver, FlightOtherLoads *others, Known *known, Room *room) {
    const KnownMap *map = &known->map;
    const size_t n = solver->n, n_gauges = solver->n_gauges, loads = N_LOADS, m = map->n_other;
    known->flight = flight;
    known->solver = solver;
    known->others = others;
    known->mean = (Errors){.tables = solver->tables,
                           .other_loads = others->tables,
                           .scaled_covariance = solver->scaled_covariance,
                           .load_strain_covariance = flight->load_strain_covariance,
                           .load_covariance = flight->load_covariance,
                           .other_strain_covariance = others->map.strain_covariance,
                           .other_variance = others->map.variance};
    Errors *own = &known->own;
    known->shift = taken(room, in_lanes(map->n_powers));
    made_arrays(map, &flight->tables, 0, known->shift, &known->tables, &own->tables, room);
    if (m > 0) {
        const TableMap *other_loads = &others->map.tables;
        made_arrays(map, other_loads, n_gauges + loads, known->shift, &known->other_loads, &own->other_loads, room);
    }
    own->scaled_covariance = taken(room, n * n);
    TAKE(room, in_lanes(map->n_parameters), &known->value, &known->std, &known->weight);
    known->along = taken(room, in_lanes(map->n_powers));
    known->products = taken(room, known_product_size(map, n_gauges));
    if (room->next == NULL) {
        return;
    }
    own->load_strain_covariance = known->products + n_gauges * n_gauges;
    own->load_covariance = own->load_strain_covariance + loads * n_gauges;
    own->other_strain_covariance = own->load_covariance + loads * loads;
    own->other_variance = own->other_strain_covariance + m * n_gauges;
    for (size_t p = 0; p < map->n_parameters; p++) {
        known->value[p] = known->std[p] = NAN;
    }
}

/* Whether a parameter is known with a standard deviation, so that the tables follow it. */
static int parameter_known(const Known *known, const Inputs *in, size_t which) {
    const double value = in->value[in->first[PARAMETER_RUN] + which], std = in->value[in->first[PARAMETER_STD_RUN] + which];
    return value != in->map->not_known && isfinite(value) && std > 0.0 && isfinite(std)
        && parameter_score(in->parameters, which, value) <= known->map.largest_score;
}

static int any_parameter_known(const Known *known, const Inputs *in) {
    int any = 0;
    for (size_t k = 0; known->present && k < in->parameters->count; k++) {
        any |= parameter_known(known, in, k);
    }
    return any;
}

/* Note what the inputs know, NaN for nothing; whether it differs from what the tables are for. */
static int note_values(Known *known, const Inputs *in) {
    const double *value = in->value + in->first[PARAMETER_RUN], *std = in->value + in->first[PARAMETER_STD_RUN];
    int other = 0;
    for (size_t p = 0; p < known->map.n_parameters; p++) {
        const int is_known = parameter_known(known, in, p) && known->map.spread[p] > 0.0;
        const double now[2] = {is_known ? value[p] : NAN, is_known ? std[p] : NAN};
        other |= is_known ? now[0] != known->value[p] || now[1] != known->std[p] : !isnan(known->value[p]);
        known->value[p] = now[0];
        known->std[p] = now[1];
    }
    return other;
}

/* z to a power of 0 to 3, as a product: the same bits on every platform. */
static double power_of(double z, double power) {
    double product = 1.0;
    for (int k = 1; k <= LARGEST_POWER; k++) {
        product *= (double)k <= power ? z : 1.0;
    }
    return product;
}

/* k of each parameter, shift_j and along_j of each power; 0 for a parameter that is not known. */
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

/* Errors per p_inf^2 about what is known, summed in the order of the file: no parameter, pairs of powers, spreads. */
static void set_products(Known *known, size_t n_gauges, size_t n) {
    const KnownMap *map = &known->map;
    const size_t size = known_product_size(map, n_gauges);
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

/* Let solver and loads use tables and errors: pointers alone change. Responses belong to the tables before. */
static void use(Known *known, const Errors *errors) {
    FlightSolver *solver = known->solver;
    FlightOtherLoads *others = known->others;
    solver->tables = errors->tables;
    solver->scaled_covariance = errors->scaled_covariance;
    known->flight->load_strain_covariance = errors->load_strain_covariance;
    known->flight->load_covariance = errors->load_covariance;
    others->tables = errors->other_loads;
    others->map.strain_covariance = errors->other_strain_covariance;
    others->map.variance = errors->other_variance;
    solver->response.known = others->response.known = 0;
    known->in_use = errors == &known->own;
}

void known_follow(Known *known, const Inputs *inputs) {
    if (!any_parameter_known(known, inputs)) {
        known_forget(known);
        return;
    }
    const int other = note_values(known, inputs);
    if (other) {
        weigh(known);
        /* A new round: every cell is made again when it is next read. */
        known->tables.parts.round = known->other_loads.parts.round = known->tables.parts.round + 1.0;
        set_products(known, known->solver->n_gauges, known->solver->n);
    }
    if (other || !known->in_use) {
        use(known, &known->own);
    }
}

void known_forget(Known *known) {
    if (known->in_use) {
        use(known, &known->mean);
    }
}
