/* The state of the estimator as bytes: everything that a step leaves to the next one, and nothing that follows from
   it.

       inputs and settings (float64) | whole numbers of the last event | a byte per gauge: valid, given | tare | renewal |
       filter | track of the nonlinear estimator

   Masks, matrices and outputs are computed again after reading. Bytes may come from anywhere: every number is
   checked first, and nothing of the instance changes where one is not allowed. core/state.c adds header and
   checksum. docs/developers/native.md, "States, derivatives, messages". */

#include <stdio.h>
#include <string.h>

#include "interface.h"
#include "../../core/floating.h"

enum { VALID_BIT = 1, GIVEN_BIT = 2 };

static size_t input_size(const Estimator *e) {
    return sizeof(double) * (e->inputs.first[N_INPUT_RUNS] + N_WHOLE) + e->map.n_gauges;
}

static size_t tared_size(const Estimator *e) {
    return input_size(e) + tare_state_size(&e->tare);
}

static size_t linear_size(const Estimator *e) {
    return tared_size(e) + renewal_state_size(e);
}

size_t model_state_size(const Model *model) {
    const Estimator *e = estimator_of(model);
    return linear_size(e) + filter_state_size(&e->filter)
         + (e->flight.present ? sizeof(Track) : 0);
}

void model_write_state(const Model *model, unsigned char *bytes) {
    const Estimator *e = estimator_of(model);
    if (e->flight.present) {
        memcpy(bytes + linear_size(e) + filter_state_size(&e->filter), &e->flight.base, sizeof e->flight.base);
    }
    filter_write_state(&e->filter, bytes + linear_size(e));
    tare_write_state(&e->tare, bytes + input_size(e));
    renewal_write_state(e, bytes + tared_size(e));
    memcpy(bytes, e->inputs.value, sizeof(double) * e->inputs.first[N_INPUT_RUNS]);
    bytes += sizeof(double) * e->inputs.first[N_INPUT_RUNS];
    memcpy(bytes, e->settled, sizeof e->settled);
    bytes += sizeof e->settled;
    for (size_t i = 0; i < e->map.n_gauges; i++) {
        bytes[i] = (unsigned char)(e->inputs.valid[i] * VALID_BIT + e->inputs.given[i] * GIVEN_BIT);
    }
}

/* What is wrong with bytes of a state; NULL if nothing is. */
static const char *fault_of(const Estimator *e, const unsigned char *bytes) {
    char text[MODEL_TEXT_SIZE];
    for (size_t i = 0; i < e->inputs.first[N_INPUT_RUNS]; i++) {
        if (!inputs_accept(&e->inputs, i, double_at(bytes, i), text)) {
            return "holds a setting that is not allowed";
        }
    }
    for (size_t i = 0; i < N_WHOLE; i++) {
        const double whole = double_at(bytes, e->inputs.first[N_INPUT_RUNS] + i);
        const size_t most = i == 0 ? OUTSIDE : i == TARE_WHOLE ? TARE_REFUSED : e->map.n_gauges;
        if (!(whole >= 0.0 && whole <= (double)most)) {
            return "holds a health or a number of gauges that there is not";
        }
    }
    for (size_t i = 0; i < e->map.n_gauges; i++) {
        if (bytes[sizeof(double) * (e->inputs.first[N_INPUT_RUNS] + N_WHOLE) + i] > VALID_BIT + GIVEN_BIT) {
            return "holds a gauge that is neither valid nor not";
        }
    }
    if (!tare_state_fits(&e->tare, bytes + input_size(e))) {
        return "holds a tare that cannot be";
    }
    if (!renewal_state_fits(e, bytes + tared_size(e))) {
        return "holds zero offsets that are not allowed";
    }
    if (!filter_state_fits(&e->filter, bytes + linear_size(e))) {
        return "holds samples of the filter that cannot be";
    }
    if (e->flight.present) {
        Track track;
        memcpy(&track, bytes + linear_size(e) + filter_state_size(&e->filter), sizeof track);
        if (!flight_track_fits(&e->flight, &track)) {
            return "holds a flight state that cannot be";
        }
    }
    return NULL;
}

int model_check_state(const Model *model, const unsigned char *bytes, char text[MODEL_TEXT_SIZE]) {
    const Floating host = floating_enter();
    const char *fault = fault_of(estimator_of(model), bytes);
    floating_leave(&host);
    snprintf(text, MODEL_TEXT_SIZE, "%s", fault != NULL ? fault : "");
    return fault == NULL;
}

void model_read_state(Model *model, const unsigned char *bytes) {
    Estimator *e = estimator_of(model);
    if (e->flight.present) {
        memcpy(&e->flight.base, bytes + linear_size(e) + filter_state_size(&e->filter), sizeof e->flight.base);
    }
    filter_read_state(&e->filter, bytes + linear_size(e));
    tare_read_state(&e->tare, bytes + input_size(e));
    const Floating host = floating_enter();
    renewal_read_state(e, bytes + tared_size(e));
    floating_leave(&host);
    memcpy(e->inputs.value, bytes, sizeof(double) * e->inputs.first[N_INPUT_RUNS]);
    bytes += sizeof(double) * e->inputs.first[N_INPUT_RUNS];
    memcpy(e->settled, bytes, sizeof e->settled);
    bytes += sizeof e->settled;
    e->inputs.n_given = 0;
    for (size_t i = 0; i < e->map.n_gauges; i++) {
        e->inputs.valid[i] = (bytes[i] & VALID_BIT) != 0;
        e->inputs.given[i] = (bytes[i] & GIVEN_BIT) != 0;
        e->inputs.n_given += e->inputs.given[i];
    }
    e->outdated = e->noise_outdated = 1;
}
