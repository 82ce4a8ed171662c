#include "law.h"

#include <math.h>
#include <string.h>

#include "../numerics/arrays.h"
#include "../numerics/lanes.h"

size_t law_doubles(const Laws *laws) {
    return laws->order + laws->n * (laws->order + laws->n_considered + laws->zeros.columns) + zero_errors_noted(&laws->zeros)
         + in_lanes(laws->n_parameters) + in_lanes(laws->n_modes) + in_lanes(laws->n_sensors);
}

size_t laws_doubles(const Laws *laws) {
    return 4 * law_doubles(laws) + zero_errors_doubles(&laws->zeros) + in_lanes(laws->n_parameters) + laws->order;
}

static void law_arrays(const Laws *laws, Law *law, double **doubles) {
    law->mean = taken(doubles, laws->order);
    law->covariance = taken(doubles, laws->n * laws->order);
    law->cross = taken(doubles, laws->n * laws->n_considered);
    law->of_zeros = taken(doubles, laws->n * laws->zeros.columns);
    law->zero = taken(doubles, zero_errors_noted(&laws->zeros));
    law->stated = taken(doubles, in_lanes(laws->n_parameters));
    law->amplitude = taken(doubles, in_lanes(laws->n_modes));
    law->known = taken(doubles, in_lanes(laws->n_sensors));
}

void laws_arrays(Laws *laws, double **doubles) {
    law_arrays(laws, &laws->law, doubles);
    law_arrays(laws, &laws->next_law, doubles);
    law_arrays(laws, &laws->predicted, doubles);
    law_arrays(laws, &laws->stationary, doubles);
    zero_errors_arrays(&laws->zeros, doubles);
    laws->stated = taken(doubles, in_lanes(laws->n_parameters));
    laws->motion.factor = taken(doubles, laws->order);
}

void law_note(const Laws *laws, Law *law) {
    zero_errors_note(&laws->zeros, law->zero);
    memcpy(law->stated, laws->stated, laws->n_parameters * sizeof *law->stated);
    thermal_tell(laws->thermal, law->amplitude, law->known); /* nothing of a map without modes */
}

int laws_hold(const Laws *laws) {
    return zero_errors_same(&laws->zeros, laws->law.zero)
        && (laws->zeros.may_move || memcmp(laws->law.stated, laws->stated, laws->n_parameters * sizeof *laws->stated) == 0);
}

void laws_take_next(Laws *laws) {
    const Law law = laws->law;
    laws->law = laws->next_law;
    laws->next_law = law;
}

void laws_keep_predicted(Laws *laws) {
    const Law next = laws->next_law;
    laws->next_law = laws->predicted;
    laws->predicted = next;
}

size_t law_state_size(const Laws *laws) {
    return sizeof(double) * law_doubles(laws);
}

void law_write_state(const Laws *laws, int has_law, unsigned char *bytes) {
    const Law *law = &laws->law;
    if (!has_law) {
        memset(bytes, 0, law_state_size(laws));
        return;
    }
    memcpy(bytes, law->mean, law_state_size(laws));
    if (!zero_errors_noted_any(&laws->zeros, law->zero)) {
        const size_t before = (size_t)(law->of_zeros - law->mean);
        memset(bytes + sizeof(double) * before, 0, sizeof(double) * laws->n * laws->zeros.columns);
    }
}

int law_state_fits(const Laws *laws, const unsigned char *bytes) {
    int good = 1;
    for (size_t k = 0; k < law_doubles(laws); k++) {
        double value;
        memcpy(&value, bytes + k * sizeof value, sizeof value);
        good = good && isfinite(value);
    }
    return good;
}

void law_read_state(Laws *laws, const unsigned char *bytes) {
    memcpy(laws->law.mean, bytes, law_state_size(laws));
}
