/* Memory of the nonlinear solver, and the errors that its gauges have.

   All arrays of gauges have n = n_gauges in multiples of LANES, so that products need no remainder; what lies beyond
   n_gauges is 0. The solver holds three covariances (n, n) of which S is made in each iteration
   (strain_covariance.c): of errors that do not scale, of pressure off the tables per p_inf^2, and of considered
   errors per p_inf^2. Only the first one changes: with zero offsets and temperature sensors it is

       gauge_covariance = Gamma_g (the map's, or what known sensors leave of thermal strain) + added,

   the same sum as of the linear map (update/added_noise.c). The weights of the search follow it.
   docs/explanation/nonlinear_estimator.md, "Model discrepancy". */

#include "flight_solver.h"

#include "flight_search.h"

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
    solver->gauge_covariance = taken(room, n * n);
    solver->scaled_covariance = taken(room, n * n);
    solver->considered_covariance = taken(room, n * n);
    solver->factor = taken(room, n * n);
    solver->full.factor = taken(room, n * n);
    solver->inverse = taken(room, n * n);
    solver->search_strain = taken(room, SEARCH_STARTS * SEARCH_STATES * n);
    solver->search_whitened = taken(room, SEARCH_STARTS * SEARCH_STATES * n);
    solver->search_factor = taken(room, n * n);
    solver->search_weight = taken(room, n);
    solver->search_slope[0] = taken(room, n);
    solver->search_slope[1] = taken(room, n);
    solver->sample.strain = taken(room, n);
    solver->solution.standardised_residual = taken(room, n);
    solver->squares = taken(room, n);
    solver->right = taken(room, N_RIGHT * n);
    solver->turned = taken(room, N_RIGHT * n);
    solver->full.right = taken(room, N_RIGHT * n);
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
    flight_search_prepare(solver);
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
    flight_search_weigh(solver);
}
