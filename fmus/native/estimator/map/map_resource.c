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

#include <math.h>

#define GUID_SIZE 80

static void take_form(MapFile *file, Map *map) {
    const size_t n = map->n_gauges, n_prior = map->known_prior ? map->n_states : 0;
    ScaledForm *form = &map->form;
    MAP_READ(file, "scaled", SCALED, ScaledForm, form);
    form->n_fixed = form->follows_pressure ? form->n_free : n;
    form->n_columns = form->follows_pressure || n_prior > n ? n : n_prior;
    form->has_errors = map_has(file, "scaled_errors");
    if (form->has_errors) {
        MAP_READ(file, "scaled_errors", SCALED_ERRORS, ScaledForm, form);
    }
}

/* Start values lie within the limits of settings: the state of an instance that holds them is accepted. */
static void take_settings(MapFile *file, Map *map) {
    MAP_READ(file, "settings", SETTINGS, Map, map);
    const double smallest = map->smallest_setting, largest = map->largest_setting;
    map_require_between(file, "settings.reference_area", map->reference_area, smallest, largest);
    map_require_between(file, "settings.reference_length", map->reference_length, smallest, largest);
    map_require_between(file, "settings.moment_station", map->moment_station, -largest, largest);
    map_require_between(file, "settings.sensor_range", map->sensor_range, smallest, largest);
}

int map_parse(MapFile *file, Map *map) {
    map->checksum = u32_at(file->bytes, CHECKSUM_AT);
    map->guid = map_text(file, "guid", GUID_SIZE);
    MAP_READ(file, "linear", LINEAR, Map, map);
    take_settings(file, map);
    MAP_READ(file, "envelope", ENVELOPE, Envelope, &map->envelope);
    map->envelope.atmosphere = (Atmosphere){map->envelope.n_layers, map->envelope.layers};
    map->form.n_free = map->known_prior ? 0 : map->n_gauges - (size_t)map->degrees_of_freedom;
    map_require(file, map->known_prior || map->form.n_free == map->n_states, "linear.degrees_of_freedom",
                "that of the gauges less the free states");
    take_form(file, map);
    if (map_has(file, "angles")) {
        MAP_READ(file, "angles", ANGLES, Map, map);
    }
    map->has_tables = map_has(file, "flight");
    map->has_filter = map_has(file, "filter");
    map->has_known = map_has(file, "parameter_tables");
    return file->good;
}

double ambient_pressure(const Envelope *envelope, double altitude) {
    double pressure, temperature;
    return atmosphere_at(&envelope->atmosphere, altitude, &pressure, &temperature) ? pressure : NAN;
}
