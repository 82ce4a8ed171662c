#include "flight_curvature.h"

#include <math.h>
#include <string.h>

#include "../../core/elementary.h"

enum { BY_MM, BY_MU, BY_MW, BY_UU, BY_UW, BY_WW };
enum { AMPLITUDE, OF_MACH, OF_ANGLE, OF_MACH_TWICE, OF_BOTH, OF_ANGLE_TWICE };

size_t curvature_doubles(const TableMap *map) {
    const size_t harmonics = in_lanes(map->n_harmonics);
    return N_CURVED * (in_lanes(map->n_rows) + map->n_channels * harmonics + 2 * harmonics);
}

void curvature_arrays(const FlightTables *tables, Curvature *curvature, double **doubles) {
    for (int k = 0; k < N_CURVED; k++) {
        curvature->value[k] = *doubles;
        curvature->amplitude[k] = curvature->value[k] + in_lanes(tables->map->n_rows);
        curvature->wind[2 * k] = curvature->amplitude[k] + tables->width;
        curvature->wind[2 * k + 1] = curvature->wind[2 * k] + tables->harmonics;
        *doubles = curvature->wind[2 * k + 1] + tables->harmonics;
    }
}

/* Coefficients at a Mach number and an incidence, and their derivatives. */
static void combine(const FlightTables *tables, double mach, double incidence, Curvature *curvature) {
    const TableMap *map = tables->map;
    const size_t stride = (map->n_incidence + 2) * tables->width;
    const Basis first = flight_basis(map->mach_knots, map->n_mach, mach);
    const Basis second = flight_basis(map->incidence_knots, map->n_incidence, incidence);
    double bend[2][N_LOCAL];
    if (tables->parts != NULL) {
        flight_make_cells(tables, first.first, second.first);
    }
    basis_curvature(map->mach_knots, map->n_mach, mach, &first, bend[0]);
    basis_curvature(map->incidence_knots, map->n_incidence, incidence, &second, bend[1]);
    const double *const of_mach[] = {first.value, first.slope, bend[0]};
    const double *const of_angle[] = {second.value, second.slope, bend[1]};
    static const unsigned char ORDER[N_CURVED][2] = {{0, 0}, {1, 0}, {0, 1}, {2, 0}, {1, 1}, {0, 2}};
    for (int k = 0; k < N_CURVED; k++) {
        double *sum = curvature->amplitude[k];
        memset(sum, 0, tables->width * sizeof *sum);
        for (size_t i = 0; i < N_LOCAL; i++) {
            for (size_t j = 0; j < N_LOCAL; j++) {
                const double *cell = tables->cells + (first.first + i) * stride + (second.first + j) * tables->width;
                const double factor = of_mach[ORDER[k][0]][i] * of_angle[ORDER[k][1]][j];
                for (size_t c = 0; c < tables->width; c++) {
                    sum[c] += factor * cell[c];
                }
            }
        }
    }
}

typedef struct {
    double real, imaginary;
} Complex;

static Complex product(Complex a, Complex b) {
    return (Complex){a.real * b.real - a.imaginary * b.imaginary, a.real * b.imaginary + a.imaginary * b.real};
}

static Complex sum_of(double x, Complex a, double y, Complex b) {
    return (Complex){x * a.real + y * b.real, x * a.imaginary + y * b.imaginary};
}

/* Powers m of z = (u + i w) / incidence, which are cos m phi_T + i sin m phi_T, and their derivatives:
   z^m' = m z^(m-1) z', z^m'' = m (m-1) z^(m-2) z' z' + m z^(m-1) z''. */
static void set_wind(const FlightTables *tables, double u, double w, double incidence, Curvature *curvature) {
    static const unsigned char PAIR[3][2] = {{0, 0}, {0, 1}, {1, 1}};
    const double x[2] = {u, w}, square = incidence * incidence, cube = square * incidence;
    const Complex point = {u, w}, unit[2] = {{1.0, 0.0}, {0.0, 1.0}};
    Complex slope[2], bend[3], power[3] = {{0.0, 0.0}, {0.0, 0.0}, {1.0, 0.0}}; /* z^(m-2), z^(m-1), z^m */
    for (int k = 0; k < 2; k++) {
        slope[k] = sum_of(1.0 / incidence, unit[k], -x[k] / cube, point);
    }
    for (int p = 0; p < 3; p++) {
        const int k = PAIR[p][0], l = PAIR[p][1];
        const double twice = 3.0 * x[k] * x[l] / (cube * square) - (k == l ? 1.0 : 0.0) / cube;
        bend[p] = sum_of(1.0, sum_of(-x[l] / cube, unit[k], -x[k] / cube, unit[l]), twice, point);
    }
    for (size_t m = 0; m < tables->map->n_harmonics; m++) {
        const double order = (double)m;
        Complex found[N_CURVED] = {power[2]};
        for (int k = 0; k < 2; k++) {
            found[1 + k] = sum_of(order, product(power[1], slope[k]), 0.0, point);
        }
        for (int p = 0; p < 3; p++) {
            const Complex both = product(slope[PAIR[p][0]], slope[PAIR[p][1]]);
            found[3 + p] =
                sum_of(order * (order - 1.0), product(power[0], both), order, product(power[1], bend[p]));
        }
        for (int k = 0; k < N_CURVED; k++) {
            curvature->wind[2 * k][m] = found[k].real;
            curvature->wind[2 * k + 1][m] = found[k].imaginary;
        }
        power[0] = power[1];
        power[1] = power[2];
        power[2] = product(power[2], sum_of(1.0 / incidence, point, 0.0, point));
    }
}

/* Sum over the harmonics of a term: an amplitude times a phase. */
static double term_sum(const FlightTables *tables, const Curvature *curvature, size_t term, int amplitude, int phase) {
    const size_t harmonics = tables->harmonics;
    const double *cosine = tables->cosine + term * harmonics, *sine = tables->sine + term * harmonics;
    const double *of_channel = curvature->amplitude[amplitude] + (size_t)tables->map->channel[term] * harmonics;
    const double *c = curvature->wind[2 * phase], *s = curvature->wind[2 * phase + 1];
    double sum = 0.0;
    for (size_t m = 0; m < tables->map->n_harmonics; m++) {
        sum += of_channel[m] * (cosine[m] * c[m] + sine[m] * s[m]);
    }
    return sum;
}

void flight_curvature(const FlightTables *tables, const double *state, Curvature *curvature) {
    const TableMap *map = tables->map;
    const double x[2] = {state[STATE_U], state[STATE_W]}, pressure = exponential(state[STATE_PRESSURE]);
    const double incidence = sqrt((x[0] * x[0] + x[1] * x[1]) + map->min_incidence * map->min_incidence);
    const double along[2] = {x[0] / incidence, x[1] / incidence};
    combine(tables, state[STATE_MACH], incidence, curvature);
    set_wind(tables, x[0], x[1], incidence, curvature);
    for (int k = 0; k < N_CURVED; k++) {
        memset(curvature->value[k], 0, map->n_rows * sizeof(double));
    }
    for (size_t t = 0; t < map->n_terms; t++) {
        const size_t row = (size_t)map->row[t];
        const double of_both = term_sum(tables, curvature, t, OF_BOTH, 0);
        const double of_angle = term_sum(tables, curvature, t, OF_ANGLE, 0);
        const double twice = term_sum(tables, curvature, t, OF_ANGLE_TWICE, 0);
        double turned[2];
        curvature->value[BY_MM][row] += pressure * term_sum(tables, curvature, t, OF_MACH_TWICE, 0);
        for (int k = 0; k < 2; k++) {
            const double of_mach = term_sum(tables, curvature, t, OF_MACH, 1 + k);
            turned[k] = term_sum(tables, curvature, t, OF_ANGLE, 1 + k);
            curvature->value[BY_MU + k][row] += pressure * (of_both * along[k] + of_mach);
        }
        for (int k = 0; k < 2; k++) {
            for (int l = k; l < 2; l++) {
                const double bend = ((k == l ? 1.0 : 0.0) - along[k] * along[l]) / incidence;
                const double of_phase = term_sum(tables, curvature, t, AMPLITUDE, 3 + k + l);
                curvature->value[BY_UU + k + l][row] +=
                    pressure * ((twice * along[k] * along[l] + of_angle * bend)
                                + (along[k] * turned[l] + along[l] * turned[k]) + of_phase);
            }
        }
    }
}

const double *second_derivative(const Curvature *curvature, double *const *jacobian, size_t k, size_t l) {
    static const unsigned char PLACE[3][3] = {{BY_MM, BY_MU, BY_MW}, {BY_MU, BY_UU, BY_UW}, {BY_MW, BY_UW, BY_WW}};
    return k == STATE_PRESSURE ? jacobian[l] : l == STATE_PRESSURE ? jacobian[k] : curvature->value[PLACE[k][l]];
}
