/* Loads in addition to the five over the flight state: rolling moment, section loads, hinge moments of a map with
   tables.

   Load j is a row of tables on the knots of strain, corrected by strain as the five are, and so are its errors
   (flight_loads.c):

       f_j = L_j(x) + Gamma_jd S^-1 r,
       var f_j = (J_j - K_j J) H_full^-1 (J_j - K_j J)' + Gamma_jj - K_j Gamma_dj + (f_j - f_full,j)^2.

   Only variances are put out, no covariances among these loads. Where air data do not give the pressure,
   policies/ambiguity.c has found factors on the standard deviations of the five loads; load j takes the factor of
   the load that it is stated to be like, the largest if it is like none. Other solutions of the sample
   (policies/other_solutions.c) at differences delta add part delta^2. Strain corrects all solutions alike, so that
   the tables alone differ. docs/explanation/nonlinear_estimator.md, "Lost gauges" and "Without q_inf and p_inf". */

#include "flight_other_loads.h"

#include <math.h>
#include <string.h>

#include "../../core/elementary.h"
#include "../numerics/cholesky.h"
#include "flight_loads.h"

int flight_other_loads_parse(MapFile *file, const FlightMap *flight, size_t n_loads, FlightOtherLoadsMap *map) {
    map->tables = flight->tables; /* for the knots */
    tables_parse(file, "flight_loads", n_loads, &map->tables);
    map_require(file, map->tables.n_harmonics == flight->tables.n_harmonics, "flight_loads.table",
                "the harmonics of the strains");
    MAP_READ(file, "flight_loads", FLIGHT_LOADS, FlightOtherLoadsMap, map);
    return file->good;
}

void flight_other_loads_arrays(FlightOtherLoads *other_loads, size_t n_gauges, Room *room) {
    const TableMap *map = &other_loads->map.tables;
    if (map->n_rows > 0) {
        flight_tables_arrays(map, &other_loads->tables, room);
        response_arrays(map, &other_loads->response, room);
        TAKE(room, map->n_rows * in_lanes(n_gauges), &other_loads->turned, &other_loads->full_turned);
        other_loads->others = taken(room, map->n_rows * MOST_OTHERS);
    }
}

/* The factor on a coefficient's or a load's standard deviation, of the five loads' factors, for load j. */
static double widening_of(const double *of_five, const OtherLoadsMap *map, size_t j) {
    const size_t like = (size_t)map->like[j];
    double largest = 1.0;
    for (size_t i = 0; i < N_LOADS; i++) {
        largest = of_five[i] > largest ? of_five[i] : largest;
    }
    return like < N_LOADS ? of_five[like] : largest;
}

/* The tables at the other solutions; the response is left at the last of them. */
static void set_others(FlightOtherLoads *other_loads, const FlightSolver *solver) {
    const size_t m = other_loads->map.tables.n_rows;
    const Solution *solution = &solver->solution;
    for (size_t s = 0; s < solution->n_others; s++) {
        flight_response(&other_loads->tables, solver->wide, solution->other_state[s], &other_loads->response);
        memcpy(other_loads->others + s * m, other_loads->response.value, m * sizeof(double));
    }
}

/* part delta^2 of load j, and of its coefficient, whose q_inf differs too. */
static void of_others(const FlightOtherLoads *other_loads, const FlightSolver *solver, size_t j, double dynamic,
                      double reference, double variance[2]) {
    const Solution *solution = &solver->solution;
    const double own = other_loads->response.value[j];
    variance[0] = variance[1] = 0.0;
    for (size_t s = 0; s < solution->n_others; s++) {
        const double load = other_loads->others[s * other_loads->map.tables.n_rows + j];
        const double mach = solution->other_state[s][STATE_MACH];
        const double other = solver->map->half_gamma * mach * mach * exponential(solution->other_state[s][STATE_PRESSURE]);
        const double apart = (load / other - own / dynamic) / reference;
        variance[0] += solution->other_part[s] * ((load - own) * (load - own));
        variance[1] += solution->other_part[s] * (apart * apart);
    }
}

/* A standard deviation with another variance, which is 0 of most samples. */
static double joined(double std, double variance) {
    return variance > 0.0 ? sqrt(std * std + variance) : std;
}

/* Load j, its coefficient at the references of the settings, and their standard deviations. `turn` goes from
   references of the map to references of the settings. */
static void set_load(const FlightOtherLoads *other_loads, const FlightSolver *solver, const Inputs *inputs, size_t j,
                     const PressureErrors *pressure, OtherLoads *out) {
    const FlightMap *map = solver->map;
    const FlightOtherLoadsMap *own_map = &other_loads->map;
    const Response *response = &other_loads->response;
    const double *full_turned = other_loads->full_turned + j * solver->n, *covariance = solver->full.state_covariance;
    const int is_moment = out->map.is_moment[j] > 0.0;
    const double reference = map->reference_area * (is_moment ? map->reference_length : 1.0);
    const double own =
        scalar_input(inputs, REFERENCE_AREA) * (is_moment ? scalar_input(inputs, REFERENCE_LENGTH) : 1.0);
    const double scale = 1.0 / (pressure->dynamic * reference), turn = reference / own;
    double by_state[N_STATES];
    const double load =
        flight_corrected(solver, solver->right, response, j, other_loads->turned + j * solver->n, by_state);
    const LoadErrors errors = flight_load_errors(solver, pressure, response, j, load, full_turned, scale);
    const double left = flight_load_square(solver, own_map->variance[j] + own_map->considered_variance[j], N_LOADS + j,
                                           N_LOADS + j, full_turned, full_turned);
    const double remaining = left > 0.0 ? left : 0.0; /* of a load that strain determines wholly, rounding leaves less */
    const double variance =
        quadratic(N_STATES, errors.by_state, covariance, errors.by_state) + remaining + errors.apart * errors.apart;
    const double of_both = quadratic(N_STATES, errors.of_coefficient, covariance, errors.of_coefficient)
                         + scale * scale * remaining + errors.coefficient_apart * errors.coefficient_apart;
    const double *widening = solver->solution.widening + N_STATES;
    const int is_widened = widening[0] != 0.0;
    const double of_load = is_widened ? widening_of(widening, &out->map, j) : 1.0;
    const double of_other = is_widened ? widening_of(widening + N_LOADS, &out->map, j) : 1.0;
    double others[2];
    of_others(other_loads, solver, j, pressure->dynamic, reference, others);
    out->value[OTHER_LOADS][j] = load;
    out->value[OTHER_LOADS_STD][j] = joined(of_load * sqrt(variance), others[0]);
    out->value[OTHER_COEFFICIENTS][j] = turn * (scale * load);
    out->value[OTHER_COEFFICIENTS_STD][j] =
        joined(of_other * turn * sqrt(pressure->wider * of_both), turn * turn * others[1]);
}

void flight_other_loads_at(FlightOtherLoads *other_loads, const FlightSolver *solver, const Inputs *inputs, OtherLoads *out) {
    const size_t m = other_loads->map.tables.n_rows;
    set_others(other_loads, solver);
    flight_response(&other_loads->tables, solver->wide, solver->state, &other_loads->response);
    flight_turn(solver, other_loads->map.strain_covariance, m, other_loads->turned);
    flight_turn_full(solver, other_loads->map.strain_covariance, other_loads->map.considered_strain_covariance, N_LOADS, m,
                     other_loads->full_turned);
    const PressureErrors pressure = flight_pressure_errors(solver);
    for (size_t j = 0; j < m; j++) {
        set_load(other_loads, solver, inputs, j, &pressure, out);
    }
}

void other_loads_unknown(OtherLoads *out) {
    for (size_t j = 0; j < N_OTHER_VALUES * out->map.n_loads; j++) {
        out->value[0][j] = NAN; /* all arrays, which follow each other */
    }
}
