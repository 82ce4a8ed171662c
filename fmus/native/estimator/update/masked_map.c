#include "masked_map.h"

#include <math.h>
#include <string.h>

#include "../numerics/triangles.h"

size_t masked_map_doubles(const Map *map) {
    return triangle_column(map->n_gauges) + map->n_gauges;
}

size_t masked_map_indices(const Map *map) {
    return 2 * map->n_gauges;
}

size_t workspace_doubles(const Map *map) {
    return 3 * map->n_gauges * map->n_gauges;
}

void masked_map_arrays(const Map *map, MaskedMap *masked, double **doubles, size_t **indices) {
    const size_t n = map->n_gauges;
    masked->triangle = *doubles;
    masked->z_scale = masked->triangle + triangle_column(n);
    masked->used = *indices;
    masked->group = masked->used + n;
    *doubles += masked_map_doubles(map);
    *indices += masked_map_indices(map);
}

void workspace_arrays(const Map *map, Workspace *work, double **doubles, size_t **indices) {
    const size_t n = map->n_gauges;
    work->first = *doubles;
    work->second = work->first + n * n;
    work->third = work->second + n * n;
    work->order = *indices;
    *doubles += workspace_doubles(map);
    *indices += n;
}

/* The gauges that are missing, then those in use, both ascending; the number of the missing. */
static size_t missing_first(const Map *map, MaskedMap *masked, size_t *order) {
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

/* The first columns of the R of a QR decomposition of the columns of a packed triangle in the given order. With the missing
   gauges first, [W_R W_K] = Q [R_RR R_RK; 0 R_KK], and R_KK whitens the residual of the others. */
static void reordered_triangle(int wide, size_t n, size_t columns, const double *packed, const size_t *order, double *a) {
    for (size_t j = 0; j < columns; j++) {
        const size_t height = order[j] + 1;
        memcpy(a + j * n, packed + triangle_column(order[j]), height * sizeof *a);
        memset(a + j * n + height, 0, (n - height) * sizeof *a);
    }
    householder_triangle(wide, n, columns, a);
}

/* A lower bound of the smallest singular value of a triangle by columns: 1 over the norm of its inverse; not a positive
   number where it has none. */
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

/* Information that the gauges in use hold on a state, as a fraction of what all gauges hold: the minimum over the states.
   The matrix work->first holds the reordered triangle R of the residual, of which the leading block R_RR belongs to the
   missing gauges; with the triangle r of their noise whitening, the fraction is the square of the smallest singular value of
   R_RR r^-1: a lower bound of it where that is enough. */
static double information_left(const Map *map, size_t n_missing, Workspace *work) {
    const size_t n = map->n_gauges;
    double *r = work->second, *ratio = work->third;
    for (size_t j = 0; j < n_missing; j++) {
        const size_t gauge = work->order[j];
        for (size_t i = 0; i < n; i++) {
            r[j * n + i] = i < gauge ? 0.0 : map->noise_whitening[triangle_column(i) + gauge];
        }
    }
    householder_triangle(work->wide, n, n_missing, r);
    for (size_t j = 0; j < n_missing; j++) {
        double *column = ratio + j * n_missing;
        memset(column, 0, n_missing * sizeof *column);
        memcpy(column, work->first + j * n, (j + 1) * sizeof *column);
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
    const double smallest = least * least >= map->min_information ? least : smallest_singular_value(n_missing, ratio);
    return smallest * smallest;
}

/* Whether the gauges in use identify the state. Without the prior, more missing gauges than the residual has degrees
   of freedom never do: W_R then lacks rank. */
static int identifies(const Map *map, size_t n_missing, Workspace *work) {
    if (n_missing == map->n_gauges) {
        return 0;
    }
    if (n_missing == 0 || map->known_prior) {
        return 1;
    }
    return n_missing <= (size_t)map->degrees_of_freedom
        && information_left(map, n_missing, work) >= map->min_information;
}

/* R_KK of the residual, and the scales of z. */
static void set_residual(const Map *map, MaskedMap *masked, size_t n_missing, const Workspace *work) {
    const size_t n = map->n_gauges;
    reordered_triangle(work->wide, n, n, map->residual_triangle, work->order, work->first);
    for (size_t k = 0; k < masked->n_used; k++) {
        double *column = masked->triangle + triangle_column(k);
        memcpy(column, work->first + (n_missing + k) * n + n_missing, (k + 1) * sizeof *column);
        const double precision = dot(k + 1, column, column);
        const int checked = precision > map->min_precision[masked->used[k]];
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
            const size_t first = group[i] < group[j] ? group[i] : group[j];
            const size_t other = group[i] < group[j] ? group[j] : group[i];
            for (size_t k = 0; k <= j; k++) {
                group[k] = group[k] == other ? first : group[k];
            }
        }
    }
}

void masked_map_groups(const Map *map, MaskedMap *masked, Workspace *work) {
    if (!masked->grouped) {
        set_residual(map, masked, missing_first(map, masked, work->order), work);
        set_groups(map, masked);
        masked->grouped = 1;
    }
}

void masked_map_prepare(const Map *map, MaskedMap *masked, Workspace *work) {
    const size_t n_missing = missing_first(map, masked, work->order);
    masked->grouped = 0;
    reordered_triangle(work->wide, map->n_gauges, n_missing, map->residual_triangle, work->order, work->first);
    masked->identified = identifies(map, n_missing, work);
    if (!masked->identified) {
        return;
    }
    const int freedom = map->degrees_of_freedom - (int)n_missing;
    masked->chi_square_limit = freedom > 0 ? map->chi_square_limit[freedom - 1] : INFINITY;
    masked->outlier_threshold = map->outlier_threshold[masked->n_used - 1];
}
