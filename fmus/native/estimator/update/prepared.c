/* The matrices of a map for the gauges in use and for the standard deviations of zero offsets: made once for each,
   and kept.

   Two things change what follows from a map. Another set of gauges asks for a MaskedMap; CACHED_MASKS sets are kept,
   since gauges that come and go return to the same few sets, and the one that has not been used for longest gives
   way. Other standard deviations of zero offsets change the covariance itself,

       added = diag(zero_std^2) + zero_common_std^2 1 1'        (n_strains, n_strains),

   and with it all matrices: added_noise.c makes these in parts, and every MaskedMap is made again.
   docs/explanation/theory.md, "Missing and suspect gauges"; docs/reference/step_time.md, "Matrices for other zero
   offsets". */

#include "update.h"

#include <math.h>
#include <string.h>

/* What a step needs of a map for the gauges in use, once per set: whether they identify the state, thresholds, and
   which gauges cannot be distinguished.

   W = D^-1/2 V at the nominal dynamic pressure (scaled_form.c at s = 1) has a row of zeros for each free state, and P (n, n)
   = W' W is the precision of strain with all gauges. With the columns of the missing gauges M first and the gauges in use K
   behind them,

       [W_M W_K] = Q [R_MM X; 0 W_rest],

   W_rest' W_rest is the precision of the gauges in use, the missing ones being marginalised (docs/explanation/theory.md,
   "Missing and suspect gauges": P_KK - P_KM P_MM^-1 P_MK). Without a prior the information that the gauges in use
   have on a state, over the information of all gauges, is (in the worst state) the square of the smallest singular
   value of R_MM r^-1, where r is the R of L^-1 of the missing gauges alone: R_MM measures what the others do not
   explain of a missing gauge, r its own noise. Below min_information the state counts as not identified.

   Correlation of two leave-one-out residuals: (P_K)_ij / sqrt(P_ii P_jj). Gauges of a correlation of nearly 1 cannot
   be distinguished and form a group; the relation is continued through a third gauge. W_rest and the group of a suspect are
   made when there is one; a step without does with the first n_missing columns. */

/* The missing gauges, then those in use, both ascending: the order of the columns. The result is the number of the
   missing. */
static size_t missing_first(Prepared *prepared) {
    const Map *map = prepared->map;
    MaskedMap *masked = prepared->masked;
    size_t *order = prepared->order;
    size_t missing = 0, used = 0;
    for (size_t i = 0; i < map->n_gauges; i++) {
        if (masked->mask[i]) {
            masked->used[used++] = i;
        } else {
            order[missing++] = i;
        }
    }
    memcpy(order + missing, masked->used, used * sizeof *order);
    masked->n_used = used;
    return missing;
}

/* R_MM, and W_rest of so many columns in all, in prepared->first. */
static void eliminate_missing(Prepared *prepared, size_t n_missing, size_t columns) {
    const Map *map = prepared->map;
    const size_t n = map->n_gauges;
    double *root = prepared->second;
    for (size_t a = 0; a < n; a++) {
        const double size = map->made->singular[a];
        root[a] = a < map->form.n_free ? 0.0 : sqrt(1.0 / (1.0 + size * size));
    }
    for (size_t j = 0; j < columns; j++) {
        const double *column = map->made->whitening + prepared->order[j] * n;
        for (size_t a = 0; a < n; a++) {
            prepared->first[j * n + a] = root[a] * column[a];
        }
    }
    householder_columns(prepared->noise.wide, n, n_missing, columns, prepared->first, NULL);
}

/* A lower bound of the smallest singular value of a triangle T: 1 / |T^-1|_F, an inverse column at a time. 0 where T
   is singular. */
static double least_singular_value(size_t n, const double *triangle, double *column) {
    double square = 0.0;
    for (size_t j = 0; j < n; j++) {
        if (!(fabs(triangle[j * n + j]) > 0.0)) {
            return 0.0;
        }
        memset(column, 0, n * sizeof *column);
        column[j] = 1.0;
        solve_triangle(n, j + 1, triangle, column);
        square += dot(j + 1, column, column);
    }
    return 1.0 / sqrt(square);
}

/* The square of the smallest singular value of R_MM r^-1. The cheap lower bound decides most sets; an exact value is
   computed where it does not suffice. */
static double information_left(Prepared *prepared, size_t n_missing) {
    const Map *map = prepared->map;
    const size_t n = map->n_gauges;
    double *r = prepared->second, *ratio = prepared->third;
    for (size_t j = 0; j < n_missing; j++) {
        const size_t gauge = prepared->order[j];
        for (size_t i = 0; i < n; i++) {
            r[j * n + i] = i < gauge ? 0.0 : map->made->noise_whitening[triangle_column(i) + gauge];
        }
    }
    householder_columns(prepared->noise.wide, n, n_missing, n_missing, r, NULL);
    for (size_t j = 0; j < n_missing; j++) {
        double *column = ratio + j * n_missing;
        memset(column, 0, n_missing * sizeof *column);
        memcpy(column, prepared->first + j * n, (j + 1) * sizeof *column);
        /* Column j of R_MM r^-1, by substitution from the left. */
        for (size_t m = 0; m < j; m++) {
            for (size_t i = 0; i <= m; i++) {
                column[i] -= ratio[m * n_missing + i] * r[j * n + m];
            }
        }
        for (size_t i = 0; i <= j; i++) {
            column[i] /= r[j * n + j];
        }
    }
    const double least = least_singular_value(n_missing, ratio, r);
    const double smallest = least * least >= map->min_information ? least : smallest_singular_value(n_missing, ratio, r);
    return smallest * smallest;
}

/* A known prior identifies every state. Without one, more missing gauges than degrees of freedom leave W_M without
   full rank. */
static int identifies(Prepared *prepared, size_t n_missing) {
    const Map *map = prepared->map;
    if (n_missing == map->n_gauges) {
        return 0;
    }
    if (n_missing == 0 || map->known_prior) {
        return 1;
    }
    if (n_missing > (size_t)map->degrees_of_freedom) {
        return 0;
    }
    const double information = map->has_low_rank ? low_rank_information(prepared->scaled, prepared->masked)
                                                 : information_left(prepared, n_missing);
    return information >= map->min_information;
}

/* W_rest, and the P_ii of the gauges in use. */
static void set_precisions(Prepared *prepared) {
    const size_t n = prepared->map->n_gauges, n_missing = missing_first(prepared), n_used = prepared->masked->n_used;
    eliminate_missing(prepared, n_missing, n);
    for (size_t k = 0; k < n_used; k++) {
        const double *column = prepared->first + (n_missing + k) * n + n_missing;
        prepared->second[k] = dot(n_used, column, column);
    }
}

/* Whether the z of two gauges in use, by their places among these, are correlated beyond the limit. A P_ii of the size of
   rounding means that no other gauge checks this one. */
static int correlated(const Prepared *prepared, size_t i, size_t j) {
    const Map *map = prepared->map;
    const MaskedMap *m = prepared->masked;
    const size_t n = map->n_gauges, n_missing = n - m->n_used;
    if (map->has_low_rank) {
        return low_rank_correlated(prepared->scaled, m->used[i], m->used[j]);
    }
    const double *rest = prepared->first + n_missing * n + n_missing, *precision = prepared->second;
    const double product = dot(m->n_used, rest + i * n, rest + j * n);
    const double limit = map->ambiguous_correlation, *least = map->made->min_precision;
    return precision[i] > least[m->used[i]] && precision[j] > least[m->used[j]]
        && product * product >= limit * limit * (precision[i] * precision[j]);
}

/* From the worst gauge on, those that a member of the group is correlated with join it. */
void prepared_group(Prepared *prepared, size_t worst) {
    const MaskedMap *m = prepared->masked;
    const size_t in_group = prepared->map->n_gauges; /* of members, before their first is known */
    size_t *group = prepared->group, *member = prepared->order, members = 1, first = worst;
    if (prepared->grouped == m->number && prepared->worst == worst) {
        return;
    }
    if (prepared->map->has_low_rank) {
        low_rank_set_precisions(prepared->scaled, m);
    } else {
        set_precisions(prepared);
    }
    for (size_t k = 0; k < m->n_used; k++) {
        group[k] = k;
    }
    group[worst] = in_group;
    member[0] = worst;
    for (size_t next = 0; next < members; next++) {
        for (size_t k = 0; k < m->n_used; k++) {
            if (group[k] != in_group && correlated(prepared, member[next], k)) {
                group[k] = in_group;
                member[members++] = k;
                first = k < first ? k : first;
            }
        }
    }
    for (size_t k = 0; k < members; k++) {
        group[member[k]] = first;
    }
    prepared->grouped = m->number;
    prepared->worst = worst;
}

static void prepare_masked(Prepared *prepared) {
    const Map *map = prepared->map;
    MaskedMap *masked = prepared->masked;
    const size_t n_missing = missing_first(prepared);
    if (!map->has_low_rank) {
        eliminate_missing(prepared, n_missing, n_missing);
    }
    masked->identified = identifies(prepared, n_missing);
    if (!masked->identified) {
        return;
    }
    const int freedom = map->degrees_of_freedom - (int)n_missing;
    masked->chi_square_limit = freedom > 0 ? map->chi_square_limit[freedom - 1] : INFINITY;
    masked->outlier_threshold = map->outlier_threshold[masked->n_used - 1];
}

void prepared_arrays(Map *map, size_t n_strains, Prepared *prepared, Room *room) {
    const size_t n = map->n_gauges;
    prepared->map = map;
    for (int k = 0; k < CACHED_MASKS; k++) {
        MaskedMap *masked = &prepared->cache[k];
        masked->used = piece(room, n, sizeof *masked->used);
        masked->mask = piece(room, n, 1);
    }
    prepared->mask = piece(room, n, 1);
    if (!map->has_low_rank) {
        TAKE(room, n * n, &prepared->first, &prepared->second, &prepared->third);
    }
    prepared->order = piece(room, n, sizeof *prepared->order);
    prepared->group = piece(room, n, sizeof *prepared->group);
    added_noise_arrays(map, &prepared->noise, room);
    prepared->n_strains = n_strains;
    TAKE(room, n_strains + 1, &prepared->noise_std, &prepared->next_std);
}

int prepared_begin(Prepared *prepared) {
    added_noise_begin(&prepared->noise);
    while (!added_noise_part(&prepared->noise, SIZE_MAX)) {
    }
    return added_noise_hand_out(&prepared->noise, prepared->map);
}

void prepared_follow(Prepared *prepared, const Inputs *inputs) {
    const size_t n = prepared->map->n_gauges;
    const double range = scalar_input(inputs, SENSOR_RANGE);
    const int silent = readings_silent(inputs);
    /* The usual step: the same gauges as in the last one, without looking at the cache. */
    if (!silent && prepared->masked != NULL && readings_are_of(inputs, prepared->masked->mask)) {
        return;
    }
    for (size_t i = 0; i < n; i++) {
        prepared->mask[i] = !silent && gauge_in_use(inputs, i, range);
    }
    int oldest = 0;
    prepared->uses++;
    for (int k = 0; k < CACHED_MASKS; k++) {
        if (prepared->last_use[k] > 0 && memcmp(prepared->cache[k].mask, prepared->mask, n) == 0) {
            prepared->last_use[k] = prepared->uses;
            prepared->masked = &prepared->cache[k];
            return;
        }
        oldest = prepared->last_use[k] < prepared->last_use[oldest] ? k : oldest;
    }
    prepared->last_use[oldest] = prepared->uses;
    prepared->masked = &prepared->cache[oldest];
    memcpy(prepared->masked->mask, prepared->mask, n);
    /* The number is new: what steps have computed for the set that was here before does not count. */
    prepared->masked->number = prepared->uses;
    prepare_masked(prepared);
}

int prepared_holds(const Prepared *prepared, const double *std) {
    return memcmp(prepared->noise_std, std, (prepared->n_strains + 1) * sizeof *std) == 0;
}

void prepared_renew(Prepared *prepared, const double *std) {
    const size_t n = prepared->n_strains, stride = prepared->map->n_gauges;
    const double common = std[n] * std[n];
    memcpy(prepared->next_std, std, (n + 1) * sizeof *std);
    for (size_t i = 0; i < n && !prepared->map->has_low_rank; i++) { /* other sensors have no zeros */
        for (size_t j = 0; j < n; j++) {
            prepared->noise.added[i * stride + j] = common + (i == j ? std[i] * std[i] : 0.0);
        }
    }
    added_noise_begin(&prepared->noise);
}

void prepared_renewed(Prepared *prepared) {
    memcpy(prepared->noise_std, prepared->next_std, (prepared->n_strains + 1) * sizeof *prepared->noise_std);
    /* Sets of gauges were prepared for the old covariance. */
    memset(prepared->last_use, 0, sizeof prepared->last_use);
    prepared->masked = NULL;
    added_noise_hand_out(&prepared->noise, prepared->map);
}
