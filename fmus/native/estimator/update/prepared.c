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

   P (n, n) = W' W is the precision of strain with all gauges, R of W = Q R is residual_triangle (added_noise.c).
   With the columns of the missing gauges M first and the gauges in use K behind them,

       [W_M W_K] = Q [R_MM R_MK; 0 R_KK],

   R_KK' R_KK is the precision of the gauges in use, the missing ones being marginalised (docs/explanation/theory.md,
   "Missing and suspect gauges": P_KK - P_KM P_MM^-1 P_MK). Without a prior the information that the gauges in use
   have on a state, over the information of all gauges, is (in the worst state) the square of the smallest singular
   value of R_MM r^-1, where r is the R of L^-1 of the missing gauges alone: R_MM measures what the others do not
   explain of a missing gauge, r its own noise. Below min_information the state counts as not identified.

   Correlation of two leave-one-out residuals: (P_K)_ij / sqrt(P_ii P_jj). Gauges of a correlation of nearly 1 cannot
   be distinguished and form a group; the relation is continued through a third gauge. Triangle and groups are made
   when a suspect needs them; a step without one does with the first n_missing columns. */

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

/* The first columns of the R of W in another order of the gauges, from the packed R: the reflections act on columns
   of R, which are shorter than columns of W. */
static void reordered_triangle(Prepared *prepared, size_t columns) {
    const size_t n = prepared->map->n_gauges, *order = prepared->order;
    const double *packed = prepared->map->made->residual_triangle;
    double *a = prepared->first;
    for (size_t j = 0; j < columns; j++) {
        const size_t height = order[j] + 1;
        memcpy(a + j * n, packed + triangle_column(order[j]), height * sizeof *a);
        memset(a + j * n + height, 0, (n - height) * sizeof *a);
    }
    householder_triangle(prepared->noise.wide, n, columns, a);
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
    householder_triangle(prepared->noise.wide, n, n_missing, r);
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

/* R_KK, and 1 / sqrt(P_ii) of each gauge in use; 0 where P_ii is rounding, so that no other gauge checks this one. */
static void set_residual(Prepared *prepared, size_t n_missing) {
    const Map *map = prepared->map;
    MaskedMap *masked = prepared->masked;
    const size_t n = map->n_gauges;
    reordered_triangle(prepared, n);
    for (size_t k = 0; k < masked->n_used; k++) {
        double *column = masked->triangle + triangle_column(k);
        memcpy(column, prepared->first + (n_missing + k) * n + n_missing, (k + 1) * sizeof *column);
        const double precision = dot(k + 1, column, column);
        const int checked = precision > map->made->min_precision[masked->used[k]];
        masked->z_scale[k] = checked ? 1.0 / sqrt(precision) : 0.0;
    }
}

/* Put gauges together whose z are correlated beyond the limit, directly or through others. */
static void set_groups(const Map *map, MaskedMap *masked) {
    size_t *group = masked->group;
    for (size_t j = 0; j < masked->n_used; j++) {
        group[j] = j;
        for (size_t i = 0; i < j; i++) {
            const double product =
                dot(i + 1, masked->triangle + triangle_column(i), masked->triangle + triangle_column(j));
            const double correlation = product * (masked->z_scale[i] * masked->z_scale[j]);
            if (fabs(correlation) < map->ambiguous_correlation || group[i] == group[j]) {
                continue;
            }
            /* Join the two groups under the smaller number, which is a member's. */
            const size_t first = group[i] < group[j] ? group[i] : group[j];
            const size_t other = group[i] < group[j] ? group[j] : group[i];
            for (size_t k = 0; k <= j; k++) {
                group[k] = group[k] == other ? first : group[k];
            }
        }
    }
}

void prepared_groups(Prepared *prepared, size_t worst) {
    if (prepared->map->has_low_rank) {
        low_rank_group(prepared->scaled, prepared->masked, worst);
    } else if (!prepared->masked->grouped) {
        set_residual(prepared, missing_first(prepared));
        set_groups(prepared->map, prepared->masked);
        prepared->masked->grouped = 1;
    }
}

static void prepare_masked(Prepared *prepared) {
    const Map *map = prepared->map;
    MaskedMap *masked = prepared->masked;
    const size_t n_missing = missing_first(prepared);
    masked->grouped = 0;
    if (!map->has_low_rank) {
        reordered_triangle(prepared, n_missing);
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
        masked->triangle = map->has_low_rank ? NULL : taken(room, triangle_column(n));
        masked->z_scale = taken(room, n);
        masked->used = piece(room, n, sizeof *masked->used);
        masked->group = piece(room, n, sizeof *masked->group);
        masked->mask = piece(room, n, 1);
    }
    prepared->mask = piece(room, n, 1);
    if (!map->has_low_rank) {
        TAKE(room, n * n, &prepared->first, &prepared->second, &prepared->third);
    }
    prepared->order = piece(room, n, sizeof *prepared->order);
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
