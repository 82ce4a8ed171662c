/* New matrices for other standard deviations of zero offsets, a part in each step.

   The covariance of the gauges includes diag(zero_std^2) + zero_common_std^2 1 1' (update/added_noise.c), so that
   other standard deviations change every matrix of the map: about a millisecond for 54 gauges. A step has a
   deadline. So it makes a part of about WORK multiplications after its estimate, and the first step after the last
   part uses them; until then `held`, the zero offsets and matrices of before, are in use together, and health is
   DEGRADED where it would be OK.

       given = held, by standard deviations     nothing to do; parts that are made are dropped
       given is other, no part made             target = given, first part
       all parts made                           held = target, or given if only values have changed since

   A step of more than SHORT iterations makes no part, except every fifth in a row (MOST_WAITED): such a step is long
   enough already. Where there is no deadline, before the first step and for samples that stand by themselves, all
   parts are made at once. So they are where a sensor of temperature comes or goes, without whose strain the old
   matrices are wrong. The state of an instance holds the number of parts: reading it makes them again.
   docs/reference/step_time.md, "Matrices for other zero offsets". */

#include "estimator.h"

#include <math.h>
#include <string.h>

#define WORK 250000       /* multiplications of a part */
#define MOST_WAITED 4.0   /* steps in a row without a part */
#define MOST_PARTS 1e6    /* of a state that may be read */

void renewal_arrays(size_t n_strains, Renewal *renewal, Room *room) {
    renewal->n_strains = n_strains;
    TAKE(room, number_of_zeros(n_strains), &renewal->held, &renewal->target);
}

static void forget_parts(Renewal *renewal) {
    renewal->parts = renewal->waited = 0.0;
    renewal->made = 0;
}

void renewal_reset(Renewal *renewal) {
    renewal->under_way = 0.0;
    forget_parts(renewal);
}

static void copy_zeros(const Renewal *renewal, const double *zeros, double *copy) {
    memcpy(copy, zeros, number_of_zeros(renewal->n_strains) * sizeof *copy);
}

static int holds(const Renewal *renewal, const double *zeros) {
    return prepared_holds(&renewal->linear->prepared, zeros + renewal->n_strains);
}

/* The map has the matrices that are made. */
static void use(Renewal *renewal) {
    forget_parts(renewal);
    linear_renewed(renewal->linear);
    if (renewal->flight->present) {
        flight_renew(renewal->flight);
    }
}

static void make_at_once(Renewal *renewal, const double *zeros) {
    Prepared *prepared = &renewal->linear->prepared;
    prepared_renew(prepared, zeros + renewal->n_strains);
    while (!added_noise_part(&prepared->noise, SIZE_MAX)) {
    }
    use(renewal);
}

/* Matrices that are made are for the known sensors. */
static void follow_sensors(Renewal *renewal) {
    const Thermal *thermal = renewal->thermal;
    AddedNoise *noise = &renewal->linear->prepared.noise;
    noise->own = thermal->some ? thermal->own : NULL;
    noise->whole = thermal->some ? thermal->noise : NULL;
}

void renewal_at_once(Renewal *renewal, const double *given, int other_sensors) {
    if (other_sensors) {
        thermal_renew(renewal->thermal);
        follow_sensors(renewal);
    }
    if (other_sensors || !holds(renewal, given)) {
        make_at_once(renewal, given);
    }
    forget_parts(renewal);
    copy_zeros(renewal, given, renewal->held);
}

/* A part of the matrices for the target. */
static void make_part(Renewal *renewal) {
    Prepared *prepared = &renewal->linear->prepared;
    if (renewal->parts == 0.0) {
        prepared_renew(prepared, renewal->target + renewal->n_strains);
    }
    renewal->parts += 1.0;
    renewal->made = added_noise_part(&prepared->noise, WORK);
}

/* Before the estimate of a step: matrices that are made come into use. Whether the map has others now. */
int renewal_begin_step(Renewal *renewal, const double *given) {
    if (renewal->under_way == 0.0) {
        const int other = !holds(renewal, given);
        renewal->under_way = 1.0;
        renewal_at_once(renewal, given, 0);
        return other;
    }
    if (holds(renewal, given)) {
        forget_parts(renewal);
        copy_zeros(renewal, given, renewal->held);
        return 0;
    }
    if (!renewal->made) {
        return 0;
    }
    use(renewal);
    copy_zeros(renewal, holds(renewal, given) ? given : renewal->target, renewal->held);
    return 1;
}

/* After the estimate: a part, unless the step was long. */
void renewal_end_step(Renewal *renewal, const double *given, int long_step) {
    if (long_step && renewal->waited < MOST_WAITED) {
        renewal->waited += 1.0;
        return;
    }
    renewal->waited = 0.0;
    if (renewal->parts == 0.0) {
        copy_zeros(renewal, given, renewal->target);
    }
    if (!renewal->made) {
        make_part(renewal);
    }
}

int renewal_pending(const Renewal *renewal, const double *given) {
    return renewal->under_way != 0.0 && !holds(renewal, given);
}

const double *renewal_zeros(const Renewal *renewal, const double *given) {
    return renewal_pending(renewal, given) ? renewal->held : given;
}

/* Serialised: under_way, parts, waited, held and target, then the known sensors, 0 or 1, and of a map with masses the
   vibration, 0 where it is not known; 0 before the first step. */

enum { N_HEAD = 3 };

static size_t n_sensors(const Renewal *renewal) {
    return renewal->thermal->present ? renewal->thermal->map.n_sensors : 0;
}

static size_t zeros_size(const Renewal *renewal) {
    return number_of_zeros(renewal->n_strains) * sizeof(double);
}

static size_t n_flags(const Renewal *renewal) {
    return n_sensors(renewal) + (n_sensors(renewal) > 0 && renewal->thermal->map.n_vibrations > 0 ? 1 : 0);
}

size_t renewal_state_size(const Renewal *renewal) {
    return (N_HEAD + n_flags(renewal)) * sizeof(double) + 2 * zeros_size(renewal);
}

void renewal_write_state(const Renewal *renewal, unsigned char *bytes) {
    const size_t size = zeros_size(renewal);
    const double head[N_HEAD] = {renewal->under_way, renewal->parts, renewal->waited};
    memcpy(bytes, head, sizeof head);
    bytes += sizeof head;
    memset(bytes, 0, renewal_state_size(renewal) - sizeof head);
    if (renewal->under_way == 0.0) {
        return;
    }
    memcpy(bytes, renewal->held, size);
    if (renewal->parts != 0.0) {
        memcpy(bytes + size, renewal->target, size);
    }
    bytes += 2 * size;
    for (size_t t = 0; t < n_sensors(renewal); t++) {
        const double known = renewal->thermal->known[t];
        memcpy(bytes + t * sizeof known, &known, sizeof known);
    }
    if (n_flags(renewal) > n_sensors(renewal)) {
        const double vibration = renewal->thermal->knows_vibration ? renewal->thermal->vibration : 0.0;
        memcpy(bytes + n_sensors(renewal) * sizeof vibration, &vibration, sizeof vibration);
    }
}

int renewal_state_fits(const Renewal *renewal, double largest_zero, const unsigned char *bytes) {
    const size_t n = renewal->n_strains, count = number_of_zeros(n);
    int good = is_flag(double_at(bytes, 0)) && double_at(bytes, 1) >= 0.0 && double_at(bytes, 2) >= 0.0
            && double_at(bytes, 1) <= MOST_PARTS * double_at(bytes, 0)
            && double_at(bytes, 2) <= MOST_WAITED * double_at(bytes, 0);
    bytes += N_HEAD * sizeof(double);
    for (size_t k = 0; k < 2 * count; k++) {
        const double least = k % count < n ? -largest_zero : 0.0;
        good = good && double_at(bytes, k) >= least && double_at(bytes, k) <= largest_zero;
    }
    bytes += 2 * zeros_size(renewal);
    for (size_t t = 0; t < n_sensors(renewal); t++) {
        good = good && is_flag(double_at(bytes, t));
    }
    return good && (n_flags(renewal) == n_sensors(renewal) || thermal_is_vibration(double_at(bytes, n_sensors(renewal))));
}

/* The sensors that matrices are for; whether they are others than before. */
static int read_sensors(Renewal *renewal, const unsigned char *bytes) {
    int other = 0;
    for (size_t t = 0; t < n_sensors(renewal); t++) {
        const unsigned char known = double_at(bytes, t) != 0.0;
        other |= renewal->thermal->known[t] != known;
        renewal->thermal->known[t] = known;
    }
    if (n_flags(renewal) > n_sensors(renewal)) {
        other |= thermal_set_vibration(renewal->thermal, double_at(bytes, n_sensors(renewal)));
    }
    renewal->thermal->outdated |= other;
    return other;
}

void renewal_read_state(Renewal *renewal, const unsigned char *bytes) {
    const size_t size = zeros_size(renewal);
    const double before = renewal->parts;
    double head[N_HEAD];
    memcpy(head, bytes, sizeof head);
    bytes += sizeof head;
    renewal->under_way = head[0];
    if (renewal->under_way == 0.0) {
        forget_parts(renewal);
        return;
    }
    memcpy(renewal->held, bytes, size);
    const int other_sensors = read_sensors(renewal, bytes + 2 * size);
    const int same = !other_sensors && holds(renewal, renewal->held);
    if (!same) {
        renewal_at_once(renewal, renewal->held, other_sensors);
    }
    renewal->waited = head[2];
    if (same && before == head[1] && memcmp(renewal->target, bytes + size, size) == 0) {
        return; /* they are made as far as that */
    }
    memcpy(renewal->target, bytes + size, size);
    renewal->parts = 0.0;
    renewal->made = 0;
    while (renewal->parts < head[1] && !renewal->made) {
        make_part(renewal);
    }
}
