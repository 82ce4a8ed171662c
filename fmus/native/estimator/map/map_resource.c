/* Parts "linear", "settings", "envelope", "scaled" and "scaled_errors" of map.bin: primary quantities of a linear
   map.

   n gauges, r states, n_e errors:

       m (n), f_mean (5)               strain and loads of the mean pressure, of which d_0, f_0 do not follow q_inf
       A (n, r), M (5, r)              strain and loads per state; free in Case 1, standard normal in Case 2
       Gamma_g (n, n)                  covariance of errors that do not scale
       N (n, n_e), N_f (5, n_e)        strain and loads of errors that scale, per standard deviation
       D_a D_b (21, n), E (t, 6, n)    errors in proportion to strain, and mean(c c') (21)

   What follows from them (whitening, directions, gains) is not in the file: update/added_noise.c makes it, so that
   the standard deviations of zero offsets may change. A matrix (n, r) lies in the file as its transpose, a row for
   each state. Infinite bounds are written as the largest finite number, as the container holds finite ones alone.
   docs/explanation/theory.md and docs/explanation/dynamic_pressure.md; strainfmu/estimator/resource/map_file.py
   writes the parts. */

#include "map_resource.h"

#include <float.h>
#include <math.h>

#define MAX_COUNT 4096
#define MAX_HALF_SPACES 65536
#define GUID_SIZE 80

/* Bounds: those that a map does not state are the largest numbers of the file, which holds finite ones alone. */
static void take_bounds(MapFile *file, const char *name, double bounds[2]) {
    map_copy(file, name, 2, bounds);
    for (int i = 0; i < 2; i++) {
        bounds[i] = fabs(bounds[i]) < DBL_MAX ? bounds[i] : copysign(INFINITY, bounds[i]);
    }
}

static void take_envelope(MapFile *file, Envelope *envelope) {
    envelope->n_half_spaces = map_length(file, "envelope.limit", 0, 0, MAX_HALF_SPACES);
    envelope->score_limit = map_number(file, "envelope.score_limit");
    take_bounds(file, "envelope.dynamic_pressure", envelope->dynamic_pressure);
    take_bounds(file, "envelope.mach_number", envelope->mach_number);
    take_bounds(file, "envelope.altitude", envelope->altitude);
    envelope->half_gamma = map_number(file, "envelope.half_gamma");
    envelope->pressure_tolerance = map_number(file, "envelope.pressure_tolerance");
    envelope->limit = map_doubles(file, "envelope.limit", envelope->n_half_spaces);
    envelope->direction = map_doubles(file, "envelope.direction", N_LOADS, envelope->n_half_spaces);
    envelope->atmosphere.n_layers = map_length(file, "envelope.layers", 0, 1, MAX_COUNT);
    envelope->atmosphere.layer = map_doubles(file, "envelope.layers", envelope->atmosphere.n_layers, LAYER_SIZE);
}

static void take_form(MapFile *file, Map *map) {
    const size_t n = map->n_gauges, n_prior = map->known_prior ? map->n_states : 0;
    ScaledForm *form = &map->form;
    form->follows_pressure = (int)map_count(file, "scaled.follows_pressure", 0, 1);
    form->n_fixed = form->follows_pressure ? form->n_free : n;
    form->n_columns = form->follows_pressure || n_prior > n ? n : n_prior;
    form->min_expected_ratio = map_number(file, "scaled.min_expected_ratio");
    form->fixed_strain = map_doubles(file, "scaled.fixed_strain", n);
    form->mean_strain = map_doubles(file, "scaled.mean_strain", n);
    form->fixed_load = map_doubles(file, "scaled.fixed_load", N_LOADS);
    form->load_of_mean = map_doubles(file, "scaled.load_of_mean", N_LOADS);
    form->spread = map_doubles(file, "scaled.spread", n, n);
    form->spread_load = map_doubles(file, "scaled.spread_load", n, N_LOADS);
    form->spread_unseen = map_doubles(file, "scaled.spread_unseen", N_LOADS, N_LOADS);
    form->has_errors = map_has(file, "scaled_errors");
    if (form->has_errors) {
        form->n_terms = map_length(file, "scaled_errors.common", 0, 0, MAX_COUNT);
        form->of_gauge = map_doubles(file, "scaled_errors.of_gauge", N_PAIRS, n);
        form->mean_product = map_doubles(file, "scaled_errors.mean_product", N_PAIRS);
        form->common = map_doubles(file, "scaled_errors.common", form->n_terms, 1 + N_LOADS, n);
    }
}

/* Start values lie within the limits of settings: the state of an instance that holds them is accepted. */
static void take_settings(MapFile *file, Map *map) {
    const double smallest = map->smallest_setting = map_between(file, "settings.smallest", DBL_MIN, 1.0);
    const double largest = map->largest_setting = map_between(file, "settings.largest", 1.0, DBL_MAX);
    map->reference_area = map_between(file, "settings.reference_area", smallest, largest);
    map->reference_length = map_between(file, "settings.reference_length", smallest, largest);
    map->moment_station = map_between(file, "settings.moment_station", -largest, largest);
    map->sensor_range = map_between(file, "settings.sensor_range", smallest, largest);
    map->dynamic_pressure = map_positive(file, "settings.dynamic_pressure");
    map->largest_zero = map_between(file, "settings.largest_zero", 0.0, DBL_MAX);
    map->not_known = map_number(file, "settings.not_known");
}

static void take_arrays(MapFile *file, Map *map) {
    const size_t n = map->n_gauges, states = map->n_states;
    map->mean_strain = map_doubles(file, "linear.mean_strain", n);
    map->load_of_mean = map_doubles(file, "linear.load_of_mean", N_LOADS);
    map->state_operator = map_doubles(file, "linear.state_operator", states, n);
    map->load_per_state = map_doubles(file, "linear.load_per_state", states, N_LOADS);
    map->n_errors = map_length(file, "linear.error_strain", 0, 0, MAX_COUNT);
    map->gauge_covariance = map_doubles(file, "linear.gauge_covariance", n, n);
    map->error_strain = map_doubles(file, "linear.error_strain", map->n_errors, n);
    map->error_load = map_doubles(file, "linear.error_load", map->n_errors, N_LOADS);
    map->chi_square_limit = map_positives(file, "linear.chi_square_limit", n);
    map->outlier_threshold = map_positives(file, "linear.outlier_threshold", n);
    map->regularisation = map_between(file, "linear.regularisation", 0.0, DBL_MAX);
    map->min_information = map_number(file, "linear.min_information");
    map->ambiguous_correlation = map_number(file, "linear.ambiguous_correlation");
    map->min_dynamic_pressure = map_positive(file, "linear.min_dynamic_pressure");
    map->max_dynamic_pressure = map_number(file, "linear.max_dynamic_pressure");
    map->dynamic_pressure_error = map_number(file, "linear.dynamic_pressure_error");
    map->chi_square_scale = map_positive(file, "linear.chi_square_scale");
    map->outlier_scale = map_positive(file, "linear.outlier_scale");
    map->level_slope = map_between(file, "linear.level_slope", 0.0, 1.0);
}

int map_parse(MapFile *file, Map *map) {
    map->checksum = u32_at(file->bytes, CHECKSUM_AT);
    map->guid = map_texts(file, "guid", 1, map_length(file, "guid", 1, 1, GUID_SIZE));
    map->n_gauges = map_length(file, "linear.mean_strain", 0, 1, MAX_COUNT);
    map->n_states = map_length(file, "linear.state_operator", 0, 0, MAX_COUNT);
    map->degrees_of_freedom = (int)map_count(file, "linear.degrees_of_freedom", 1, map->n_gauges);
    map->known_prior = (int)map_count(file, "linear.known_prior", 0, 1);
    take_settings(file, map);
    take_arrays(file, map);
    take_envelope(file, &map->envelope);
    map->form.n_free = map->known_prior ? 0 : map->n_gauges - (size_t)map->degrees_of_freedom;
    map_require(file, map->known_prior || map->form.n_free == map->n_states, "linear.degrees_of_freedom",
                "that of the gauges less the free states");
    take_form(file, map);
    map->incidence_per_force = map_has(file, "angles") ? map_positive(file, "angles.incidence_per_force") : 0.0;
    map->has_tables = map_has(file, "flight");
    map->has_filter = map_has(file, "filter");
    map->has_known = map_has(file, "parameter_tables");
    return file->good;
}

double ambient_pressure(const Envelope *envelope, double altitude) {
    double pressure, temperature;
    return atmosphere_at(&envelope->atmosphere, altitude, &pressure, &temperature) ? pressure : NAN;
}
