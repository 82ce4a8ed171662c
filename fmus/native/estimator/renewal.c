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

/* Iterations of a step that does not search the tables; a search takes more. */
#define SHORT_ITERATIONS 16

#define WORK 250000       /* multiplications of a part */
#define MOST_WAITED 4.0   /* steps in a row without a part */
#define MOST_PARTS 1e6    /* of a state that may be read */

void renewal_arrays(Estimator *e, Room *room) {
    TAKE(room, number_of_zeros(e->sensors.n_strains), &e->renewal.held, &e->renewal.target);
}

static void forget_parts(Estimator *e) {
    e->renewal.parts = e->renewal.waited = 0.0;
    e->renewal.made = 0;
}

void renewal_reset(Estimator *e) {
    e->renewal.under_way = 0.0;
    forget_parts(e);
}

static void copy_zeros(const Estimator *e, const double *zeros, double *copy) {
    memcpy(copy, zeros, number_of_zeros(e->sensors.n_strains) * sizeof *copy);
}

static int holds(const Estimator *e, const double *zeros) {
    return prepared_holds(&e->linear.prepared, zeros + e->sensors.n_strains);
}

/* The map has the matrices that are made. */
static void use(Estimator *e) {
    forget_parts(e);
    linear_renewed(&e->linear);
    if (e->flight.present) {
        flight_renew(&e->flight);
    }
}

static void make_at_once(Estimator *e, const double *zeros) {
    Prepared *prepared = &e->linear.prepared;
    prepared_renew(prepared, zeros + e->sensors.n_strains);
    while (!added_noise_part(&prepared->noise, SIZE_MAX)) {
    }
    use(e);
}

/* Matrices that are made are for the known sensors. */
static void follow_sensors(Estimator *e) {
    const Thermal *thermal = &e->thermal;
    AddedNoise *noise = &e->linear.prepared.noise;
    noise->own = thermal->some ? thermal->own : NULL;
    noise->whole = thermal->some ? thermal->noise : NULL;
}

void renewal_at_once(Estimator *e, const double *zeros, int other_sensors) {
    if (other_sensors) {
        thermal_renew(&e->thermal);
        follow_sensors(e);
    }
    if (other_sensors || !holds(e, zeros)) {
        make_at_once(e, zeros);
    }
    forget_parts(e);
    copy_zeros(e, zeros, e->renewal.held);
}

/* A part of the matrices for the target. */
static void make_part(Estimator *e) {
    Prepared *prepared = &e->linear.prepared;
    if (e->renewal.parts == 0.0) {
        prepared_renew(prepared, e->renewal.target + e->sensors.n_strains);
    }
    e->renewal.parts += 1.0;
    e->renewal.made = added_noise_part(&prepared->noise, WORK);
}

/* Before the estimate of a step: matrices that are made come into use. Whether the map has others now. */
static int follow_zeros(Estimator *e, const double *latest) {
    if (e->renewal.under_way == 0.0) {
        const int other = !holds(e, latest);
        e->renewal.under_way = 1.0;
        renewal_at_once(e, latest, 0);
        return other;
    }
    if (holds(e, latest)) {
        forget_parts(e);
        copy_zeros(e, latest, e->renewal.held);
        return 0;
    }
    if (!e->renewal.made) {
        return 0;
    }
    use(e);
    copy_zeros(e, holds(e, latest) ? latest : e->renewal.target, e->renewal.held);
    return 1;
}

void renewal_begin_step(Estimator *e) {
    if (e->noise_outdated || e->renewal.under_way == 0.0) {
        const double *latest = latest_zeros(e);
        e->outdated |= follow_zeros(e, latest);
        e->noise_outdated = e->renewal.under_way != 0.0 && !holds(e, latest);
    }
}

/* After the estimate: a part, unless the step was long. */
void renewal_end_step(Estimator *e) {
    const int is_long = e->flight.present && e->flight.solver.iterations > SHORT_ITERATIONS;
    if (!e->noise_outdated) {
        return;
    }
    if (is_long && e->renewal.waited < MOST_WAITED) {
        e->renewal.waited += 1.0;
        return;
    }
    e->renewal.waited = 0.0;
    if (e->renewal.parts == 0.0) {
        copy_zeros(e, latest_zeros(e), e->renewal.target);
    }
    if (!e->renewal.made) {
        make_part(e);
    }
}

int renewal_pending(const Estimator *e) {
    return e->noise_outdated && e->renewal.under_way != 0.0 && !holds(e, latest_zeros(e));
}

const double *zeros_in_use(const Estimator *e) {
    const double *latest = latest_zeros(e);
    return e->renewal.under_way != 0.0 && !holds(e, latest) ? e->renewal.held : latest;
}

/* Serialised: under_way, parts, waited, held and target, then the known sensors, 0 or 1, and of a map with masses the
   vibration, 0 where it is not known; 0 before the first step. */

enum { N_HEAD = 3 };

static size_t n_sensors(const Estimator *e) {
    return e->thermal.present ? e->thermal.map.n_sensors : 0;
}

static size_t zeros_size(const Estimator *e) {
    return number_of_zeros(e->sensors.n_strains) * sizeof(double);
}

static size_t n_flags(const Estimator *e) {
    return n_sensors(e) + (n_sensors(e) > 0 && e->thermal.map.n_vibrations > 0 ? 1 : 0);
}

size_t renewal_state_size(const Estimator *e) {
    return (N_HEAD + n_flags(e)) * sizeof(double) + 2 * zeros_size(e);
}

void renewal_write_state(const Estimator *e, unsigned char *bytes) {
    const size_t size = zeros_size(e);
    const double head[N_HEAD] = {e->renewal.under_way, e->renewal.parts, e->renewal.waited};
    memcpy(bytes, head, sizeof head);
    bytes += sizeof head;
    memset(bytes, 0, renewal_state_size(e) - sizeof head);
    if (e->renewal.under_way == 0.0) {
        return;
    }
    memcpy(bytes, e->renewal.held, size);
    if (e->renewal.parts != 0.0) {
        memcpy(bytes + size, e->renewal.target, size);
    }
    bytes += 2 * size;
    for (size_t t = 0; t < n_sensors(e); t++) {
        const double known = e->thermal.known[t];
        memcpy(bytes + t * sizeof known, &known, sizeof known);
    }
    if (n_flags(e) > n_sensors(e)) {
        const double vibration = e->thermal.knows_vibration ? e->thermal.vibration : 0.0;
        memcpy(bytes + n_sensors(e) * sizeof vibration, &vibration, sizeof vibration);
    }
}

int renewal_state_fits(const Estimator *e, const unsigned char *bytes) {
    const size_t n = e->sensors.n_strains, count = number_of_zeros(n);
    int good = is_flag(double_at(bytes, 0)) && double_at(bytes, 1) >= 0.0 && double_at(bytes, 2) >= 0.0
            && double_at(bytes, 1) <= MOST_PARTS * double_at(bytes, 0)
            && double_at(bytes, 2) <= MOST_WAITED * double_at(bytes, 0);
    bytes += N_HEAD * sizeof(double);
    for (size_t k = 0; k < 2 * count; k++) {
        const double least = k % count < n ? -e->map.largest_zero : 0.0;
        good = good && double_at(bytes, k) >= least && double_at(bytes, k) <= e->map.largest_zero;
    }
    bytes += 2 * zeros_size(e);
    for (size_t t = 0; t < n_sensors(e); t++) {
        good = good && is_flag(double_at(bytes, t));
    }
    return good && (n_flags(e) == n_sensors(e) || thermal_is_vibration(double_at(bytes, n_sensors(e))));
}

/* The sensors that matrices are for; whether they are others than before. */
static int read_sensors(Estimator *e, const unsigned char *bytes) {
    int other = 0;
    for (size_t t = 0; t < n_sensors(e); t++) {
        const unsigned char known = double_at(bytes, t) != 0.0;
        other |= e->thermal.known[t] != known;
        e->thermal.known[t] = known;
    }
    if (n_flags(e) > n_sensors(e)) {
        other |= thermal_set_vibration(&e->thermal, double_at(bytes, n_sensors(e)));
    }
    e->thermal.outdated |= other;
    return other;
}

void renewal_read_state(Estimator *e, const unsigned char *bytes) {
    const size_t size = zeros_size(e);
    const double before = e->renewal.parts;
    double head[N_HEAD];
    memcpy(head, bytes, sizeof head);
    bytes += sizeof head;
    e->renewal.under_way = head[0];
    if (e->renewal.under_way == 0.0) {
        forget_parts(e);
        return;
    }
    memcpy(e->renewal.held, bytes, size);
    const int other_sensors = read_sensors(e, bytes + 2 * size);
    const int same = !other_sensors && holds(e, e->renewal.held);
    if (!same) {
        renewal_at_once(e, e->renewal.held, other_sensors);
    }
    e->renewal.waited = head[2];
    if (same && before == head[1] && memcmp(e->renewal.target, bytes + size, size) == 0) {
        return; /* they are made as far as that */
    }
    memcpy(e->renewal.target, bytes + size, size);
    e->renewal.parts = 0.0;
    e->renewal.made = 0;
    while (e->renewal.parts < head[1] && !e->renewal.made) {
        make_part(e);
    }
}
