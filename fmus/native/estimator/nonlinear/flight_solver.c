/* Memory of the nonlinear solver, and the errors that its gauges have.

   All arrays of gauges have n = n_gauges in multiples of LANES, so that products need no remainder; what lies beyond
   n_gauges is 0. The solver holds three covariances (n, n) of which S is made in each iteration
   below: of errors that do not scale, of pressure off the tables per p_inf^2, and of considered
   errors per p_inf^2. Only the first one changes: with zero offsets and temperature sensors it is

       gauge_covariance = Gamma_g (the map's, or what known sensors leave of thermal strain) + added,

   the same sum as of the linear map (update/added_noise.c). The weights of the search follow it.
   docs/explanation/nonlinear_estimator.md, "Model discrepancy". */

#include "nonlinear.h"

/* A (n_gauges, n_gauges) matrix in one of order n, with zeros beyond. */
static void widen(size_t n_gauges, size_t n, const double *source, double *matrix) {
    for (size_t i = 0; i < n_gauges; i++) {
        memcpy(matrix + i * n, source + i * n_gauges, n_gauges * sizeof *matrix);
    }
}

void flight_solver_arrays(const FlightMap *map, size_t n_gauges, int wide, FlightSolver *solver, Room *room) {
    const size_t n = in_lanes(n_gauges);
    solver->map = map;
    solver->n_gauges = n_gauges;
    solver->n = n;
    solver->wide = wide;
    flight_tables_arrays(&map->tables, &solver->tables, room);
    response_arrays(&map->tables, &solver->response, room);
    TAKE(room, n * n, &solver->gauge_covariance, &solver->scaled_covariance, &solver->considered_covariance,
         &solver->factor, &solver->full.factor, &solver->inverse);
    TAKE(room, SEARCH_STARTS * SEARCH_STATES * n, &solver->search_strain, &solver->search_whitened);
    solver->search_factor = taken(room, n * n);
    TAKE(room, n, &solver->search_weight, &solver->search_slope[0], &solver->search_slope[1], &solver->sample.strain,
         &solver->solution.standardised_residual, &solver->squares);
    TAKE(room, N_RIGHT * n, &solver->right, &solver->turned, &solver->full.right);
    solver->full.turned = taken(room, N_LOADS * n);
    solver->columns = taken(room, (map->n_common + map->n_considered_common + 2) * n);
    solver->shapes = taken(room, map->n_shapes * n);
    if (map->considered.n_rows > 0) {
        flight_tables_arrays(&map->considered, &solver->full.tables, room);
        response_arrays(&map->considered, &solver->full.response, room);
    }
    solver->sample.used = piece(room, n_gauges, 1);
    if (room->next == NULL) {
        return;
    }
    widen(n_gauges, n, map->gauge_covariance, solver->gauge_covariance);
    widen(n_gauges, n, map->scaled_covariance, solver->scaled_covariance);
    widen(n_gauges, n, map->considered_covariance, solver->considered_covariance);
}

void flight_solver_add_noise(FlightSolver *solver, const double *own, const double *added) {
    const size_t n_gauges = solver->n_gauges;
    const double *without = own != NULL ? own : solver->map->gauge_covariance;
    for (size_t i = 0; i < n_gauges; i++) {
        for (size_t j = 0; j < n_gauges; j++) {
            const size_t at = i * n_gauges + j;
            solver->gauge_covariance[i * solver->n + j] = without[at] + added[at];
        }
    }
}

/* The covariance S (n, n) of strain about the tables at a flight state, and S_full with the considered errors.

   With p = p_inf, the strain y (n) and the coefficients over references c = [1, loads / (p reference)] (6) of the
   tables at the state,

       S = Gamma_g                                gauge noise, apparent strain, zero offsets: do not scale
         + p^2 E E'                               pressure off the tables, E E' = scaled_covariance
         + p^2 sum_t (E_t c)(E_t c)'              errors that gauges have in common and that follow the load
         + (g_c y)(g_c y)'                        gain error in common
         + diag(p^2 sum_ab c_a c_b D_ab + (g y)^2)   own errors of each gauge: placement, clocking, gain

   D_ab (21, n) is gauge_error_product, g and g_c (n) are standard deviations of gains. S_full adds considered errors
   of the same two kinds, p^2 (H H' + sum_t (H_t c)(H_t c)'), and one with tables of its own, a column of its strain.
   Columns in common are collected first, so that S is filled in by one pass over its lower triangle.
   docs/explanation/nonlinear_estimator.md, "Model discrepancy" and "Roles of the errors"; docs/explanation/sigma.md,
   "Errors in proportion to strain"; strain_covariance in strainfmu/estimator/reference/nonlinear.py. */

/* c (6) at the state, whose loads are the last rows of the tables. */
static void set_coefficients(const FlightSolver *solver, double c[1 + N_LOADS]) {
    const FlightMap *map = solver->map;
    const double *loads = solver->response.value + solver->n_gauges;
    c[0] = 1.0;
    for (size_t i = 0; i < N_LOADS; i++) {
        c[1 + i] = loads[i] / (solver->response.pressure * map_reference(map, i >= N_FORCES));
    }
}

/* The diagonal: p^2 sum over a <= b of c_a c_b D_ab, where pairs a < b count twice in the map, and (g y)^2. Rounding
   may leave the sum below 0. */
static void set_own(const FlightSolver *solver, const double c[1 + N_LOADS], double *own) {
    const FlightMap *map = solver->map;
    const size_t n_gauges = solver->n_gauges;
    const double *strain = solver->response.value, square = solver->response.pressure * solver->response.pressure;
    memset(own, 0, solver->n * sizeof *own);
    for (size_t a = 0, k = 0; a <= N_LOADS; a++) {
        for (size_t b = a; b <= N_LOADS; b++, k++) {
            const double pair = c[a] * c[b];
            for (size_t g = 0; g < n_gauges; g++) {
                own[g] += pair * map->gauge_error_product[k * n_gauges + g];
            }
        }
    }
    for (size_t g = 0; g < n_gauges; g++) {
        const double gain = map->gain_std[g] * strain[g];
        own[g] = square * (own[g] > 0.0 ? own[g] : 0.0) + gain * gain;
    }
}

/* Columns p E_t c of `count` errors (count, 6, n_gauges); the result is where the next column begins. */
static double *set_common(const FlightSolver *solver, const double c[1 + N_LOADS], size_t count, const double *errors,
                          double *column) {
    const size_t n = solver->n, n_gauges = solver->n_gauges;
    for (size_t t = 0; t < count; t++, column += n) {
        memset(column, 0, n * sizeof *column);
        for (size_t a = 0; a <= N_LOADS; a++) {
            const double *error = errors + (t * (1 + N_LOADS) + a) * n_gauges;
            const double factor = solver->response.pressure * c[a];
            for (size_t g = 0; g < n_gauges; g++) {
                column[g] += factor * error[g];
            }
        }
    }
    return column;
}

/* Gamma_g + p^2 (E E' + H H') + columns columns', on and below the diagonal, in whole LANES. */
EVERYWHERE void add_covariance(size_t n, size_t n_columns, double square, double considered_square,
                               const double *restrict fixed, const double *restrict scaled,
                               const double *restrict considered, const double *restrict columns, double *restrict out) {
    for (size_t j = 0; j < n; j++) {
        for (size_t i = j / LANES * LANES; i < n; i += LANES) {
            const double *restrict base = fixed + j * n + i, *restrict more = scaled + j * n + i;
            const double *restrict rest = considered + j * n + i;
            double sum[LANES];
            for (size_t r = 0; r < LANES; r++) {
                sum[r] = base[r] + square * more[r] + considered_square * rest[r];
            }
            for (size_t t = 0; t < n_columns; t++) {
                const double *restrict column = columns + t * n + i;
                const double factor = columns[t * n + j];
                for (size_t r = 0; r < LANES; r++) {
                    sum[r] += factor * column[r];
                }
            }
            memcpy(out + j * n + i, sum, sizeof sum);
        }
    }
}

FOR_AVX2(add_covariance, (size_t n, size_t n_columns, double square, double considered_square, const double *fixed,
          const double *scaled, const double *considered, const double *columns, double *out),
         (n, n_columns, square, considered_square, fixed, scaled, considered, columns, out))

/* S, or S_full; solver->squares and solver->columns are scratch. */
static void set_covariance(FlightSolver *solver, int with_considered, double *out) {
    const FlightMap *map = solver->map;
    const size_t n = solver->n;
    const double square = solver->response.pressure * solver->response.pressure;
    double c[1 + N_LOADS], *own = solver->squares, *column = solver->columns;
    set_coefficients(solver, c);
    set_own(solver, c, own);
    column = set_common(solver, c, map->n_common, map->common_error, column);
    memset(column, 0, n * sizeof *column);
    for (size_t g = 0; g < solver->n_gauges; g++) {
        column[g] = map->common_gain[g] * solver->response.value[g];
    }
    column += n;
    if (with_considered) {
        column = set_common(solver, c, map->n_considered_common, map->considered_common, column);
        if (map->considered.n_rows > 0) {
            memset(column, 0, n * sizeof *column);
            memcpy(column, solver->full.response.value, solver->n_gauges * sizeof *column);
            column += n;
        }
    }
    const size_t count = (size_t)(column - solver->columns) / n;
    CHOSEN(solver->wide, add_covariance)(n, count, square, with_considered ? square : 0.0, solver->gauge_covariance,
                                         solver->scaled_covariance, solver->considered_covariance, solver->columns, out);
    for (size_t g = 0; g < solver->n_gauges; g++) {
        out[g * n + g] += own[g];
    }
}

void flight_strain_covariance(FlightSolver *solver) {
    set_covariance(solver, 0, solver->factor);
}

void flight_full_covariance(FlightSolver *solver) {
    set_covariance(solver, 1, solver->full.factor);
}
