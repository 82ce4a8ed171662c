/* The estimator: its parts put together, what a step does, and when outputs are computed.

   Outputs are a function of the inputs and of what the last step left; they are computed when they are read
   (estimator_outputs) and stay until an input changes. The order of a sample:

       temperature and inertial sensors; matrices at once if one comes or goes      temperature/, renewal
       zero offsets in use, rows of strain at the reference temperature             sample/inputs, temperature/thermal
       loads, air data, conditions of the sample alone                              linear/ or policies/flight
       averages over the samples before                                             policies/filtered_outputs
       health, by these conditions, renewal, vibration and specific force           sample/outputs

   A step marks the outputs as stepped. Only when the next step comes, or an input changes, does the sample join the
   filter and the next flight state become the base (estimator_before_change): outputs may be read before and after
   without effect. Memory is one block that is taken at creation, doubles first, and one for each part of a
   map; numerics/memory.c frees them together. docs/developers/native.md, "States, derivatives, messages" and "The
   nonlinear step". */

#include "estimator.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Let the parts point to what they read and write of each other. */
static void connect(Estimator *e) {
    e->inputs.map = &e->map;
    e->inputs.sensors = &e->sensors;
    e->inputs.parameters = &e->parameters;
    e->linear.map = &e->map;
    e->linear.inputs = &e->inputs;
    e->linear.output = e->output;
    e->linear.other_loads = &e->other_loads;
    e->linear.wide = wide_of_processor();
    e->flight.inputs = &e->inputs;
    e->flight.output = e->output;
    e->flight.linear = &e->linear;
    e->flight.loads = &e->other_loads;
}

/* All arrays of the parts that have no block of their own. */
static void lay_out(void *part, Room *room) {
    Estimator *e = part;
    const size_t n = e->map.n_gauges, n_inputs = e->inputs.first[N_INPUT_RUNS];
    linear_arrays(&e->map, e->sensors.n_strains, &e->linear, room);
    renewal_arrays(e, room);
    e->inputs.value = taken(room, n_inputs);
    e->inputs.strain = taken(room, n);
    e->direction = taken(room, n_inputs);
    e->derivative = taken(room, estimator_derivatives(e));
    e->derivative_work = taken(room, n_inputs + 2 * estimator_derivatives(e));
    e->inputs.valid = piece(room, n, 1);
    e->inputs.given = piece(room, n, 1);
}

/* Whether the parts of a map go together: section loads scale with q_inf, tables of loads are about the map's section
   loads, filter and tables of parameters are about other tables, and a map of many gauges has strain gauges and the five
   loads alone. */
static int check_parts(MapFile *file, int follows_pressure) {
    const int flight = map_has(file, "flight"), other_loads = map_has(file, "other_loads");
    const int has_form = follows_pressure || !(other_loads || map_has(file, "scaled_errors"));
    const int of_loads = map_has(file, "flight_loads") == (flight && other_loads);
    const int of_tables = flight || !map_has(file, "parameter_tables");
    const int has_more = flight || other_loads || !follows_pressure || map_has(file, "thermal") || map_has(file, "sensors");
    const int of_many = !(map_has(file, "low_rank") && has_more);
    if (file->good && !(has_form && of_loads && of_tables && of_many)) {
        snprintf(file->text, MODEL_TEXT_SIZE, "holds parts that do not go together");
        file->good = 0;
    }
    return file->good;
}

/* Read all parts, and allocate. Order matters: parts behind need lengths of parts before. */
static int create(Estimator *e, MapFile *file) {
    const Map *map = &e->map;
    const int wide = e->linear.wide;
    if (!map_parse(file, &e->map) || !check_parts(file, map->form.follows_pressure)
        || !thermal_create(file, map->n_gauges, wide, &e->thermal) || !flow_parameters_parse(file, &e->parameters)
        || !sensor_rows_parse(file, map->n_gauges, &e->sensors)
        || !other_loads_create(file, &e->other_loads)) {
        return 0;
    }
    if (!inputs_parse(file, &e->inputs)) {
        return 0;
    }
    const size_t n_channels = e->thermal.present ? e->thermal.map.n_channels : 0;
    if (!map_require(file, n_channels == 0 || n_channels == N_INERTIAL_CHANNELS, "inertia.channels", "11")) {
        return 0;
    }
    e->inputs.n_temperatures = e->thermal.present ? e->thermal.map.n_sensors - n_channels : 0;
    e->inputs.n_inertial = n_channels > 0 ? N_INERTIAL_INPUTS : 0;
    inputs_lay_out(&e->inputs);
    if (!map_hand_out(file, lay_out, e)) {
        return 0;
    }
    if (!linear_begin(&e->linear)) {
        map_require(file, 0, "linear.gauge_covariance", "a covariance");
        return 0;
    }
    const size_t n = e->sensors.n_strains;
    if (!flight_create(&e->flight, file) || !filtered_outputs_create(file, &e->flight, &e->filter)) {
        return 0;
    }
    e->inputs.smallest_time = e->filter.map.smallest_time;
    e->inputs.largest_time = e->filter.map.largest_time;
    return tare_create(file, n, map->largest_zero, &e->tare) && map_close(file);
}

Estimator *estimator_create(Memory *memory, const unsigned char *bytes, size_t length, char text[MODEL_TEXT_SIZE]) {
    MapFile file;
    Estimator *e = memory_take(memory, sizeof *e);
    if (e == NULL) {
        snprintf(text, MODEL_TEXT_SIZE, "needs more memory than there is");
        return NULL;
    }
    connect(e);
    if (!map_open(&file, bytes, length, text)) {
        return NULL;
    }
    file.memory = memory;
    if (!create(e, &file)) {
        return NULL;
    }
    estimator_reset(e);
    e->base = (Model){.guid = e->map.guid,
                      .checksum = e->map.checksum,
                      .mode = INSTANTIATED,
                      .co_simulation_only = e->flight.present};
    e->memory = *memory;
    return e;
}

void estimator_restart(Estimator *e) {
    flight_reset(&e->flight);
    filter_reset(&e->filter);
    e->noise_outdated |= e->renewal.under_way != 0.0;
    renewal_reset(e);
    e->outdated = 1;
}

void estimator_reset(Estimator *e) {
    inputs_reset(&e->inputs);
    estimator_restart(e);
    tare_reset(&e->tare);
    e->noise_outdated = 1;
}

void estimator_before_change(Estimator *e) {
    const int flight = e->flight.base.stepped != 0.0, filter = e->filter.track.stepped != 0.0;
    if (flight || filter) {
        estimator_outputs(e);
    }
    if (flight) {
        flight_take_next(&e->flight);
    }
    if (filter) {
        filter_take_next(&e->filter, e->base.time);
    }
    e->outdated = 1;
}

int estimator_filters(const Estimator *e) {
    const int takes_steps = (e->base.mode & (EVENT | CONTINUOUS_TIME)) == 0; /* not in model exchange */
    return e->filter.present && takes_steps && e->inputs.value[single_input(&e->inputs, TIME_CONSTANT_RUN)] > 0.0;
}

/* Take a step of the filter from a point in time [s]; a filter that is off forgets all samples. */
static void step_filter(Estimator *e, double start) {
    Filter *filter = &e->filter;
    if (!estimator_filters(e)) {
        filter_reset(filter);
        return;
    }
    if (filter->track.now != start) {
        filter->track.now = start;
        e->outdated = 1;
    }
    filter->track.stepped = 1.0;
}

void estimator_step(Estimator *e, double start) {
    if (e->flight.base.stepped != 0.0 || e->filter.track.stepped != 0.0) {
        estimator_before_change(e);
    }
    renewal_begin_step(e);
    if (e->filter.present) {
        step_filter(e, start);
    }
    if (e->flight.present || e->filter.track.stepped != 0.0) {
        estimator_outputs(e);
    }
    e->flight.base.stepped = e->flight.present ? 1.0 : 0.0;
    renewal_end_step(e);
}

void estimator_renew(Estimator *e) {
    estimator_before_change(e);
    renewal_at_once(e, latest_zeros(e), 0);
    e->noise_outdated = 0;
    e->outdated = 1;
}

void estimator_follow_tare(Estimator *e) {
    if (e->tare.flags.is_up != 0.0 && !e->tare.up) {
        estimator_before_change(e);
    }
    if (tare_follow(&e->tare)) {
        e->outdated = e->noise_outdated = 1;
    }
}

void estimator_take_readings(Estimator *e) {
    const double range = scalar_input(&e->inputs, SENSOR_RANGE);
    if (tare_is_averaging(&e->tare)) {
        for (size_t i = 0; i < e->sensors.n_strains; i++) {
            e->tare.reading[i] = gauge_in_use(&e->inputs, i, range) ? e->inputs.value[i] : NAN;
        }
        tare_take(&e->tare, scalar_input(&e->inputs, DYNAMIC_PRESSURE)); /* at rest it is 0 */
    }
}

/* Filter the outputs, or have them as they are. */
static void filter_outputs(Estimator *e) {
    if (estimator_filters(e)) {
        filtered_outputs(&e->filter, &e->flight, e->inputs.value[single_input(&e->inputs, TIME_CONSTANT_RUN)]);
    } else {
        filter_without(&e->filter);
    }
}

int estimator_contradicted_force(const Estimator *e) {
    const double limit = scalar_input(&e->inputs, ALARM_SCALE) * e->map.chi_square_limit[0];
    return thermal_contradicted(&e->thermal, e->output + LOADS, e->output + LOADS_STD, limit);
}

/* Conditions of the sample alone, by its estimator, and of what surrounds it: bits of sample.h. */
static int conditions_of(const Estimator *e, int renews) {
    return (e->flight.present ? e->flight.conditions : e->linear.conditions)
         | (estimator_contradicted_force(e) != 0 ? FORCE_CONTRADICTS : 0) | (renews ? RENEWAL_PENDING : 0)
         | (thermal_vibrates(&e->thermal) ? VIBRATES : 0);
}

const double *estimator_outputs(Estimator *e) {
    if (e->outdated) {
        const double *temperature = e->inputs.value + e->inputs.first[TEMPERATURE_RUN];
        double channel[N_INERTIAL_CHANNELS], vibration = NAN;
        if (e->inputs.n_inertial > 0) {
            inertial_channels(&e->inputs, channel);
            vibration = known_vibration(&e->inputs);
        }
        const int other_sensors = e->thermal.present && thermal_read(&e->thermal, temperature, channel, vibration);
        if (other_sensors || (e->noise_outdated && e->renewal.under_way == 0.0)) {
            renewal_at_once(e, latest_zeros(e), other_sensors);
            e->noise_outdated = 0;
        }
        const int renews = renewal_pending(e);
        e->inputs.zeros = renews ? e->renewal.held : latest_zeros(e);
        readings_set_strain(&e->inputs);
        if (e->thermal.present) {
            thermal_correct(&e->thermal, e->inputs.strain);
        }
        if (e->flight.present) {
            flight_update(&e->flight);
        } else {
            linear_update(&e->linear);
        }
        e->outdated = 0;
        e->other_loads.outdated = 1;
        if (e->filter.present) {
            filter_outputs(e);
        }
        e->output[HEALTH_STATE] = health_state(conditions_of(e, renews));
    }
    return e->output;
}

const double *other_loads_of(Estimator *e) {
    if (e->other_loads.present && e->other_loads.outdated) {
        flight_other_loads_update(&e->flight);
    }
    return e->other_loads.value[0];
}

int estimator_set_input(Estimator *e, size_t input, double value, char text[MODEL_TEXT_SIZE]) {
    if (input < e->map.n_gauges) {
        readings_note_given(&e->inputs, input, input + 1);
    } else if (!inputs_accept(&e->inputs, input, value, text)) {
        return 0;
    } else if (is_zero(&e->inputs, input) && e->inputs.value[input] != value) {
        tare_drop(&e->tare);
        e->noise_outdated = 1;
    }
    e->inputs.value[input] = value;
    e->outdated = 1;
    return 1;
}
