/* Strain and loads over the flight state, with derivatives: tensor-product cubic splines of harmonics.

   A row (a gauge, a load) at x = (M, u, w, ln p) is, with the incidence a = sqrt(u^2 + w^2 + a_min^2), phi the roll
   angle of the flow, cos phi = u / a and sin phi = w / a,

       y = y_fixed + p sum over terms of sum_m T_m(M, a) (C_m cos m phi + S_m sin m phi),

   where T_m are splines of a channel: gauges that are rotations of each other share one, and differ in the factors
   C_m, S_m of their term (n_terms, n_harmonics). a_min keeps derivatives finite at the axis, where all harmonics but
   the mean vanish. With B-splines B_i of Mach number and B_j of incidence, of which four each are not zero,

       T_m = sum_ij B_i(M) B_j(a) cell_ijm,      dT_m/dM and dT_m/da by B'.

   Derivatives by u and w have two parts, by the incidence and by the phase:

       dy/du = p sum (u / a dT_m/da) phase + p sum T_m d(phase)/du,     phase = C_m cos m phi + S_m sin m phi,

   and alike by w; d/d ln p is the row less y_fixed. cos m phi and sin m phi follow from each other by addition
   theorems, so that a row costs no sine. Cells of known flow parameters are sums of parts and made when a state
   first needs them: flight_known.c. docs/explanation/nonlinear_estimator.md, "Model";
   strainfmu/estimator/map/flight_tables.py. */

#include "nonlinear.h"

#include <math.h>

#include "../../core/elementary.h"

#define MOST_COMBINED (2 * LANES) /* with AVX-512 */
#define DEGREE 3 /* of the splines */
#define N_LOCAL (DEGREE + 1)

/* The basis functions that are not zero at a point, and their derivatives. */
typedef struct {
    size_t first;
    double value[N_LOCAL], slope[N_LOCAL];
} Basis;

static size_t cells_of(const TableMap *map) {
    return (map->n_mach + 2) * (map->n_incidence + 2);
}

size_t flight_cell_doubles(const TableMap *map) {
    return cells_of(map) * map->n_channels * in_lanes(map->n_harmonics);
}

void flight_tables_arrays(const TableMap *map, FlightTables *tables, Room *room) {
    const size_t m = map->n_harmonics, harmonics = in_lanes(m);
    tables->map = map;
    tables->harmonics = harmonics;
    tables->width = map->n_channels * harmonics;
    tables->cells = taken(room, cells_of(map) * tables->width);
    TAKE(room, map->n_terms * harmonics, &tables->cosine, &tables->sine);
    double **const amplitude = tables->amplitude, **const wind = tables->wind;
    TAKE(room, tables->width, &amplitude[0], &amplitude[1], &amplitude[2]);
    TAKE(room, harmonics, &wind[0], &wind[1], &wind[2], &wind[3], &wind[4], &wind[5]);
    if (room->next == NULL) {
        return;
    }
    for (size_t k = 0; map->table != NULL && k < cells_of(map) * map->n_channels; k++) {
        memcpy(tables->cells + k * harmonics, map->table + k * m, m * sizeof(double));
    }
    for (size_t t = 0; t < map->n_terms; t++) {
        memcpy(tables->cosine + t * harmonics, map->cosine + t * m, m * sizeof(double));
        memcpy(tables->sine + t * harmonics, map->sine + t * m, m * sizeof(double));
    }
}

void response_arrays(const TableMap *map, Response *response, Room *room) {
    double **const jacobian = response->jacobian;
    TAKE(room, in_lanes(map->n_rows), &response->value, &jacobian[0], &jacobian[1], &jacobian[2], &jacobian[3]);
}

/* Knot of the splines on `knots`, whose ends are fourfold. */
static double padded(const double *knots, size_t n, size_t index) {
    return index < DEGREE ? knots[0] : index < DEGREE + n ? knots[index - DEGREE] : knots[n - 1];
}

/* The four cubic B-splines at x by Cox and de Boor's recursion, their derivatives by the splines of degree 2.
   Outside the knots x is clipped and the value goes on along the tangent. */
static Basis flight_basis(const double *knots, size_t n, double x) {
    const double inside = x < knots[0] ? knots[0] : x > knots[n - 1] ? knots[n - 1] : x;
    size_t span = 0;
    while (span + 2 < n && knots[span + 1] <= inside) {
        span++;
    }
    Basis basis = {.first = span};
    span += DEGREE;
    double lower[N_LOCAL] = {0.0}, values[N_LOCAL] = {1.0};
    for (size_t degree = 1; degree <= DEGREE; degree++) {
        memcpy(lower, values, sizeof lower);
        memset(values, 0, sizeof values);
        for (size_t j = 0; j < degree; j++) {
            const double left = padded(knots, n, span - degree + 1 + j), right = padded(knots, n, span + 1 + j);
            /* B of degree d from B of degree d - 1: two neighbours share each. */
            const double part = lower[j] / (right - left);
            values[j] += (right - inside) * part;
            values[j + 1] += (inside - left) * part;
        }
    }
    /* The slope of a spline is three times the difference of two neighbours of degree 2, each over the length of its
       support. */
    for (size_t j = 0; j < DEGREE; j++) {
        const double part =
            DEGREE * lower[j] / (padded(knots, n, span + 1 + j) - padded(knots, n, span - DEGREE + 1 + j));
        basis.slope[j] -= part;
        basis.slope[j + 1] += part;
    }
    for (size_t j = 0; j < N_LOCAL; j++) {
        basis.value[j] = values[j] + (x - inside) * basis.slope[j];
    }
    return basis;
}

/* A cell as the sum of its first part and of weighted others, marked by the round that it belongs to. */
EVERYWHERE void make_cell(const CellParts *parts, size_t width, size_t cell, double *restrict made) {
    memcpy(made, parts->part + cell * width, width * sizeof *made);
    for (size_t j = 0; j < parts->n_weights; j++) {
        const double *restrict part = parts->part + ((1 + j) * parts->n_cells + cell) * width;
        const double weight = parts->weight[j];
        for (size_t k = 0; k < width; k++) {
            made[k] += weight * part[k];
        }
    }
    parts->made[cell] = parts->round;
}

/* Make the 16 cells that the splines at a place need. */
EVERYWHERE void make_cells(const FlightTables *tables, size_t mach, size_t incidence) {
    for (size_t k = 0; k < N_LOCAL * N_LOCAL; k++) {
        const size_t cell = (mach + k / N_LOCAL) * (tables->map->n_incidence + 2) + incidence + k % N_LOCAL;
        if (tables->parts->made[cell] != tables->parts->round) {
            make_cell(tables->parts, tables->width, cell, tables->cells + cell * tables->width);
        }
    }
}

/* Coefficients k to k + count of T, dT/dM and dT/da: sums over the four knots of Mach number (p, q), then over four
   of incidence. count is a constant. */
EVERYWHERE void combine_some(size_t count, size_t k, size_t width, size_t stride, const double *restrict cells,
                             const Basis *mach, const Basis *incidence, double *restrict value, double *restrict by_mach,
                             double *restrict by_incidence) {
    double v[MOST_COMBINED] = {0.0}, m[MOST_COMBINED] = {0.0}, a[MOST_COMBINED] = {0.0};
    for (size_t j = 0; j < N_LOCAL; j++) {
        const double *cell = cells + j * width + k;
        double p[MOST_COMBINED] = {0.0}, q[MOST_COMBINED] = {0.0};
        for (size_t i = 0; i < N_LOCAL; i++) {
            for (size_t r = 0; r < count; r++) {
                p[r] += mach->value[i] * cell[i * stride + r];
                q[r] += mach->slope[i] * cell[i * stride + r];
            }
        }
        for (size_t r = 0; r < count; r++) {
            v[r] += incidence->value[j] * p[r];
            m[r] += incidence->value[j] * q[r];
            a[r] += incidence->slope[j] * p[r];
        }
    }
    for (size_t r = 0; r < count; r++) {
        value[k + r] = v[r];
        by_mach[k + r] = m[r];
        by_incidence[k + r] = a[r];
    }
}

/* All of them, `most` at once. */
EVERYWHERE void combine(size_t most, size_t width, size_t stride, const double *cells, const Basis *mach,
                        const Basis *incidence, double *value, double *by_mach, double *by_incidence) {
    size_t k = 0;
    for (; k + most <= width; k += most) {
        combine_some(most, k, width, stride, cells, mach, incidence, value, by_mach, by_incidence);
    }
    for (; k < width; k += LANES) {
        combine_some(LANES, k, width, stride, cells, mach, incidence, value, by_mach, by_incidence);
    }
}

static inline double lane_sum(const double *sum) {
    return (sum[0] + sum[1]) + (sum[2] + sum[3]);
}

/* Sums over the harmonics of one term: T phase, dT/dM phase, dT/da phase, T d(phase)/du, T d(phase)/dw. */
EVERYWHERE void contract(size_t harmonics, const double *restrict cosine, const double *restrict sine,
                         double *const *wind, const double *restrict value, const double *restrict by_mach,
                         const double *restrict by_incidence, double *restrict sums) {
    double v[LANES] = {0.0}, m[LANES] = {0.0}, a[LANES] = {0.0}, u[LANES] = {0.0}, w[LANES] = {0.0};
    for (size_t k = 0; k < harmonics; k += LANES) {
        for (size_t r = 0; r < LANES; r++) {
            const double c = cosine[k + r], s = sine[k + r];
            const double phase = c * wind[0][k + r] + s * wind[1][k + r];
            v[r] += value[k + r] * phase;
            m[r] += by_mach[k + r] * phase;
            a[r] += by_incidence[k + r] * phase;
            u[r] += value[k + r] * (c * wind[2][k + r] + s * wind[3][k + r]);
            w[r] += value[k + r] * (c * wind[4][k + r] + s * wind[5][k + r]);
        }
    }
    sums[0] = lane_sum(v);
    sums[1] = lane_sum(m);
    sums[2] = lane_sum(a);
    sums[3] = lane_sum(u);
    sums[4] = lane_sum(w);
}

/* cos m phi, sin m phi and their derivatives by u and w, from m - 1 to m by the addition theorems. d(u/a)/du = (a^2
   - u^2) / a^3, d(u/a)/dw = -u w / a^3. */
static void set_wind(const FlightTables *tables, double u, double w, double incidence) {
    const double cosine = u / incidence, sine = w / incidence, square = incidence * incidence;
    const double cube = square * incidence, across = -u * w / cube;
    const double slope[2][2] = {{(square - u * u) / cube, across}, {across, (square - w * w) / cube}};
    double *const *wind = tables->wind;
    wind[0][0] = 1.0;
    wind[1][0] = wind[2][0] = wind[3][0] = wind[4][0] = wind[5][0] = 0.0;
    for (size_t m = 1; m < tables->map->n_harmonics; m++) {
        const double c = wind[0][m - 1], s = wind[1][m - 1], order = (double)m;
        for (int by = 0; by < 2; by++) {
            const double dc = slope[by][0], ds = slope[by][1];
            wind[2 + 2 * by][m] = order * (c * dc - s * ds);
            wind[3 + 2 * by][m] = order * (s * dc + c * ds);
        }
        wind[0][m] = c * cosine - s * sine;
        wind[1][m] = s * cosine + c * sine;
    }
}

EVERYWHERE void respond(size_t most, const FlightTables *tables, const double *state, Response *response) {
    const TableMap *map = tables->map;
    const double u = state[STATE_U], w = state[STATE_W];
    const double incidence = sqrt((u * u + w * w) + map->min_incidence * map->min_incidence);
    const Basis mach = flight_basis(map->mach_knots, map->n_mach, state[STATE_MACH]);
    const Basis angle = flight_basis(map->incidence_knots, map->n_incidence, incidence);
    const size_t stride = (map->n_incidence + 2) * tables->width;
    double *const *amplitude = tables->amplitude;
    if (tables->parts != NULL) {
        make_cells(tables, mach.first, angle.first);
    }
    combine(most, tables->width, stride, tables->cells + mach.first * stride + angle.first * tables->width, &mach, &angle,
            amplitude[0], amplitude[1], amplitude[2]);
    set_wind(tables, u, w, incidence);
    /* Put the terms together: a row is the sum of one term or two. */
    const double pressure = response->pressure = exponential(state[STATE_PRESSURE]);
    const double along_u = u / incidence, along_w = w / incidence;
    for (size_t row = 0; row < map->n_rows; row++) {
        response->value[row] = map->fixed_response[row];
        for (size_t k = 0; k < N_STATES; k++) {
            response->jacobian[k][row] = 0.0;
        }
    }
    for (size_t t = 0; t < map->n_terms; t++) {
        const size_t at = (size_t)map->channel[t] * tables->harmonics, row = (size_t)map->row[t];
        double sums[5];
        contract(tables->harmonics, tables->cosine + t * tables->harmonics, tables->sine + t * tables->harmonics,
                 tables->wind, amplitude[0] + at, amplitude[1] + at, amplitude[2] + at, sums);
        response->value[row] += pressure * sums[0];
        response->jacobian[STATE_MACH][row] += pressure * sums[1];
        response->jacobian[STATE_U][row] += pressure * (along_u * sums[2] + sums[3]);
        response->jacobian[STATE_W][row] += pressure * (along_w * sums[2] + sums[4]);
        response->jacobian[STATE_PRESSURE][row] += pressure * sums[0];
    }
}

static void respond_to(const FlightTables *tables, const double *state, Response *response) {
    respond(LANES, tables, state, response);
}

#if HAS_AVX2
AVX2 static void respond_to_avx2(const FlightTables *tables, const double *state, Response *response) {
    respond(LANES, tables, state, response);
}

AVX512 static void respond_to_avx512(const FlightTables *tables, const double *state, Response *response) {
    respond(MOST_COMBINED, tables, state, response);
}
#endif

/* A response at the state that it belongs to already is not computed again: a step starts where the last one ended. */
void flight_response(const FlightTables *tables, int wide, const double *state, Response *response) {
    if (response->known && memcmp(response->state, state, sizeof response->state) == 0) {
        return;
    }
    WIDEST(wide, respond_to)(tables, state, response);
    memcpy(response->state, state, sizeof response->state);
    response->known = 1;
}
