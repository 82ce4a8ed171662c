/* Loads at a solution of the tables, corrected by what strain shows beyond them; coefficients; their covariances.

   At the state x with residual r = d - y(x), Jacobians J (n, 4) of strain and J_L (5, 4) of loads, and the
   covariance Gamma_Ld (5, n) of loads with strain by the errors that the gain may correct,

       f = L(x) + K r,      K = Gamma_Ld S^-1.

   By the factor L of S, `turned` = L^-1 Gamma_dL and `right` = L^-1 [r, J]: K r = turned' right_0 and K J = turned'
   right_1..4 (flight_corrected). What the estimate is worth follows from the full model, S_full with the considered
   errors:

       f_full = L(x) + K_full r + (J_L - K_full J) shift
       C_full = (J_L - K_full J) H_full^-1 (J_L - K_full J)' + Gamma_LL - K_full Gamma_dL
       cov f  = C_full + (f - f_full)(f - f_full)'

   f - f_full is `apart`; it is the error that the gain leaves of the considered errors, given this sample.
   Coefficients C = f / (q S_ref) have the derivatives scale (J_L - K J) - C d ln q/dx, with ln q = ln(gamma/2) + 2
   ln M + ln p. An error of ln q is normal, an error of q is not: `wider` makes three standard deviations of q reach
   as far as three of ln q, (e^(3 s) - 1) / 3 over s, squared.

   Rows beyond the five loads use the same functions. docs/explanation/nonlinear_estimator.md,
   "Roles of the errors" and "Estimate"; concluded and flight_loads in strainfmu/estimator/reference/nonlinear.py.
   Source of considered errors: Schmidt, Advances in Control Systems 3 (1966) 293. */

#include "nonlinear.h"

#include <math.h>

#include "../../core/elementary.h"

/* (e^x - 1) / 3 for x = 3 s; by its series for small x, where the difference would cancel. */
static double lognormal_deviation(double of_log) {
    const double x = 3.0 * of_log;
    if (!(x < 0.5)) {
        return (exponential(x) - 1.0) / 3.0;
    }
    double sum = 1.0; /* (e^x - 1) / x */
    for (int k = 16; k > 1; k--) {
        sum = 1.0 + sum * x / k;
    }
    return x * sum / 3.0;
}

/* q_inf at the solution, d ln q/dx, ln q less the full model's, and the square of `wider`. */
PressureErrors flight_pressure_errors(const FlightSolver *solver) {
    const FullModel *full = &solver->full;
    const double mach = solver->state[STATE_MACH];
    PressureErrors pressure = {.dynamic = solver->map->half_gamma * mach * mach * solver->response.pressure,
                            .by_state = {2.0 / mach, 0.0, 0.0, 1.0}};
    pressure.apart = -along_state(pressure.by_state, full->shift);
    const double variance = quadratic(N_STATES, pressure.by_state, full->state_covariance, pressure.by_state);
    const double of_log = sqrt(variance + pressure.apart * pressure.apart);
    const double widening = lognormal_deviation(of_log) / of_log;
    pressure.wider = widening * widening;
    return pressure;
}

/* The load of the considered error with tables of its own; 0 without. */
static double of_tables(const FlightSolver *solver, size_t load) {
    return solver->map->considered.n_rows > 0 ? solver->full.response.value[solver->n_gauges + load] : 0.0;
}

/* L^-1 Gamma_dL of `count` loads from load `first` on, at a pressure. With the covariances `considered`, NULL for none, an error
   with tables adds its strain times its load. */
static void turn(const FlightSolver *solver, const double *factor, double pressure, const double *strain_covariance,
                 const double *considered, size_t first, size_t count, double *turned) {
    const size_t n = solver->n, n_gauges = solver->n_gauges;
    const double square = pressure * pressure;
    const double *of_error = considered != NULL && solver->map->considered.n_rows > 0 ? solver->full.response.value : NULL;
    memset(turned, 0, count * n * sizeof *turned);
    for (size_t i = 0; i < count; i++) {
        const double load = of_error != NULL ? of_tables(solver, first + i) : 0.0;
        for (size_t g = 0; g < n_gauges; g++) {
            const size_t at = i * n_gauges + g;
            const double both = square * (strain_covariance[at] + (considered != NULL ? considered[at] : 0.0));
            turned[i * n + g] = !solver->sample.used[g] ? 0.0 : of_error != NULL ? both + load * of_error[g] : both;
        }
    }
    solve_lower(solver->wide, n, factor, count, turned);
}

/* At the pressure that L belongs to. */
void flight_turn(const FlightSolver *solver, const double *strain_covariance, size_t count, double *turned) {
    turn(solver, solver->factor, solver->factor_pressure, strain_covariance, NULL, 0, count, turned);
}

/* The same by L_full. */
static void flight_turn_full(const FlightSolver *solver, const double *strain_covariance, const double *considered,
                             size_t first, size_t count, double *turned) {
    turn(solver, solver->full.factor, solver->response.pressure, strain_covariance, considered, first, count, turned);
}

double flight_corrected(const FlightSolver *solver, const double *right, const Response *response, size_t row,
                        const double *turned, double *by_state) {
    const size_t n = solver->n;
    for (size_t k = 0; k < N_STATES; k++) {
        by_state[k] = response->jacobian[k][row] - dot(n, turned, right + (1 + k) * n);
    }
    return response->value[row] + dot(n, turned, right);
}

/* Derivatives of a load and of its coefficient by the state in the full model, and what they are apart from its estimates. */
typedef struct {
    double by_state[N_STATES], apart, of_coefficient[N_STATES], coefficient_apart, scale;
} LoadErrors;

/* J_L - K_full J and f - f_full of a row, and both of its coefficient. */
static LoadErrors flight_load_errors(const FlightSolver *solver, const PressureErrors *pressure, const Response *response,
                              size_t row, double value, const double *turned, double scale) {
    const FullModel *full = &solver->full;
    LoadErrors errors = {.scale = scale};
    const double of_full = flight_corrected(solver, full->right, response, row, turned, errors.by_state);
    errors.apart = value - of_full - along_state(errors.by_state, full->shift);
    for (size_t k = 0; k < N_STATES; k++) {
        errors.of_coefficient[k] = scale * errors.by_state[k] - scale * value * pressure->by_state[k];
    }
    errors.coefficient_apart = scale * errors.apart - scale * value * pressure->apart;
    return errors;
}

/* Gamma_LL - K_full Gamma_dL of two loads: what strain leaves of them at a fixed state. */
static double flight_load_square(const FlightSolver *solver, double square, size_t load, size_t other, const double *turned,
                          const double *other_turned) {
    const double pressure = solver->response.pressure;
    return pressure * pressure * square + of_tables(solver, load) * of_tables(solver, other)
         - dot(solver->n, turned, other_turned);
}

/* cov f of two loads of which strain leaves `remaining`, and in *of_coefficients that of their coefficients. */
static double covariance_of(const FlightSolver *solver, const PressureErrors *pressure, const LoadErrors *a, const LoadErrors *b,
                            double remaining, double *of_coefficients) {
    const double *of_state = solver->full.state_covariance;
    const double of_both = quadratic(N_STATES, a->of_coefficient, of_state, b->of_coefficient) + a->scale * remaining * b->scale
                         + a->coefficient_apart * b->coefficient_apart;
    *of_coefficients = pressure->wider * of_both;
    return quadratic(N_STATES, a->by_state, of_state, b->by_state) + remaining + a->apart * b->apart;
}

void flight_set_loads(FlightSolver *solver) {
    const FlightMap *map = solver->map;
    const size_t n = solver->n;
    FullModel *full = &solver->full;
    Solution *solution = &solver->solution;
    double *turned = solver->turned, by_state[N_STATES];
    LoadErrors errors[N_LOADS];
    for (size_t i = 0; i < N_STATES; i++) {
        for (size_t j = 0; j < N_STATES; j++) {
            const size_t at = i * N_STATES + j;
            solution->widened_covariance[at] = full->state_covariance[at] + full->shift[i] * full->shift[j];
        }
    }
    const PressureErrors pressure = flight_pressure_errors(solver);
    flight_turn(solver, map->load_strain_covariance, N_LOADS, turned);
    flight_turn_full(solver, map->load_strain_covariance, map->considered_load_strain_covariance, 0, N_LOADS, full->turned);
    for (size_t i = 0; i < N_LOADS; i++) {
        const size_t row = solver->n_gauges + i;
        const double scale = 1.0 / (pressure.dynamic * map_reference(map, i >= N_FORCES));
        solution->loads[i] = flight_corrected(solver, solver->right, &solver->response, row, turned + i * n, by_state);
        solution->coefficients[i] = scale * solution->loads[i];
        errors[i] = flight_load_errors(solver, &pressure, &solver->response, row, solution->loads[i], full->turned + i * n,
                                       scale);
    }
    for (size_t i = 0; i < N_LOADS; i++) {
        for (size_t j = 0; j < N_LOADS; j++) {
            const size_t at = i * N_LOADS + j;
            const double remaining =
                flight_load_square(solver, map->load_covariance[at] + map->considered_load_covariance[at], i, j,
                                   full->turned + i * n, full->turned + j * n);
            solution->load_covariance[at] =
                covariance_of(solver, &pressure, &errors[i], &errors[j], remaining, &solution->coefficient_covariance[at]);
        }
    }
}

/* Angles, Mach number and pressures of a flight state, with standard deviations and whether strain and air data
   identify them.

   The flow comes along (cos a, sin a w / a, sin a u / a): aft, to starboard, up, with a = sqrt(u^2 + w^2 + a_min^2).
   Hence

       angle of attack = atan2(z, along),    sideslip = -asin(y),    total angle = a,    roll angle = atan2(w, u)
       M,    p_inf = e^(ln p),    q_inf = gamma/2 M^2 p_inf.

   Standard deviations are to first order, row C row' with the covariance C (4, 4) of the state. The derivatives of y
   and z by u and w have the factor across = sin a / a, whose slope by a is (cos a - across) / a. Three cases leave
   first order:

       at zero incidence the direction is undetermined: the variance of a grows by v = (a_min / a)^2 (C_uu + C_ww),
       the variance of the roll angle by v / a^2
       a pressure is lognormal: the standard deviation s of its logarithm becomes (e^(3 s) - 1) / 3
       a roll angle that may be any has pi / sqrt(3), the standard deviation of an even distribution over a full turn

   A quantity counts as identified where its state is known better than by the ranges of the map (min_gain), the roll
   angle also where incidence exceeds its own error. docs/explanation/nonlinear_estimator.md, "What comes out";
   air_data in strainfmu/estimator/reference/air.py. */

static const double PI = 3.1415926535897931;

static double signed_angle(double y, double x) {
    return y < 0.0 ? -angle_of(-y, x) : angle_of(y, x);
}

/* Derivatives of the angles by u and w; the direction of the wind is (along, y, z). */
typedef struct {
    double along, y, z;
    double by_along[2], by_y[2], by_z[2], by_incidence[2];
} Wind;

/* The direction of the flow and its derivatives by u and w. */
static Wind wind_of(double u, double w, double incidence) {
    Wind wind;
    double sine;
    const double part[2] = {u / incidence, w / incidence};
    sine_cosine(incidence, &sine, &wind.along);
    const double across = sine / incidence, slope = (wind.along - across) / incidence;
    wind.y = across * w;
    wind.z = across * u;
    for (int k = 0; k < 2; k++) {
        wind.by_incidence[k] = part[k];
        wind.by_along[k] = -sine * part[k];
        wind.by_z[k] = slope * part[k] * u + (k == 0 ? across : 0.0);
        wind.by_y[k] = slope * part[k] * w + (k == 1 ? across : 0.0);
    }
    return wind;
}

/* Whether each quantity is identified; q_inf needs both M and p_inf. */
static void set_flags(const FlightMap *map, const double *prior_std, const Solution *solution, double incidence_std,
                      unsigned char *flag) {
    int known[N_STATES];
    const double u = solution->state[STATE_U], w = solution->state[STATE_W];
    for (size_t k = 0; k < N_STATES; k++) {
        known[k] = sqrt(solution->widened_covariance[k * N_STATES + k]) < map->min_gain * prior_std[k];
    }
    const int angles = known[STATE_U] && known[STATE_W];
    const double score = map->min_incidence_score * incidence_std;
    flag[ANGLE_OF_ATTACK] = flag[SIDESLIP_ANGLE] = flag[TOTAL_INCIDENCE] =
        (unsigned char)angles;
    flag[WIND_ROLL_ANGLE] = (unsigned char)(angles && sqrt(u * u + w * w) > score);
    flag[AIR_MACH_NUMBER] = (unsigned char)known[STATE_MACH];
    flag[AIR_PRESSURE] = (unsigned char)known[STATE_PRESSURE];
    flag[AIR_DYNAMIC] = (unsigned char)(known[STATE_MACH] && known[STATE_PRESSURE]);
}

void flight_air_data(const FlightMap *map, const double *prior_std, const Solution *solution, double *value,
                     unsigned char *is_identified) {
    const double mach = solution->state[STATE_MACH], u = solution->state[STATE_U], w = solution->state[STATE_W];
    const double least = map->tables.min_incidence, incidence = sqrt((u * u + w * w) + least * least);
    const double pressure = exponential(solution->state[STATE_PRESSURE]);
    const double dynamic = map->half_gamma * mach * mach * pressure;
    const Wind wind = wind_of(u, w, incidence);
    const double plane = wind.along * wind.along + wind.z * wind.z, other = sqrt(1.0 - wind.y * wind.y);
    double *std = value + N_AIR_DATA;
    double row[N_AIR_DATA][N_STATES] = {{0.0}};
    value[ANGLE_OF_ATTACK] = signed_angle(wind.z, wind.along);
    value[SIDESLIP_ANGLE] = -signed_angle(wind.y, other);
    value[TOTAL_INCIDENCE] = incidence;
    value[WIND_ROLL_ANGLE] = signed_angle(w, u);
    value[AIR_MACH_NUMBER] = mach;
    value[AIR_PRESSURE] = pressure;
    value[AIR_DYNAMIC] = dynamic;
    for (int k = 0; k < 2; k++) {
        /* d atan2(z, along) = (along dz - z d along) / (along^2 + z^2); d asin(y) = dy / sqrt(1 - y^2). */
        row[ANGLE_OF_ATTACK][STATE_U + k] = (wind.along * wind.by_z[k] - wind.z * wind.by_along[k]) / plane;
        row[SIDESLIP_ANGLE][STATE_U + k] = -wind.by_y[k] / other;
        row[TOTAL_INCIDENCE][STATE_U + k] = wind.by_incidence[k];
    }
    row[WIND_ROLL_ANGLE][STATE_U] = -w / (incidence * incidence);
    row[WIND_ROLL_ANGLE][STATE_W] = u / (incidence * incidence);
    row[AIR_MACH_NUMBER][STATE_MACH] = 1.0;
    row[AIR_PRESSURE][STATE_PRESSURE] = pressure;
    row[AIR_DYNAMIC][STATE_MACH] = 2.0 * dynamic / mach;
    row[AIR_DYNAMIC][STATE_PRESSURE] = dynamic;
    /* Without incidence the wind has no direction: its error is all of the incidence. */
    const double *covariance = solution->widened_covariance, part = least / incidence;
    const double any = part * part * (covariance[STATE_U * N_STATES + STATE_U] + covariance[STATE_W * N_STATES + STATE_W]);
    const double added[N_AIR_DATA] = {[TOTAL_INCIDENCE] = any, [WIND_ROLL_ANGLE] = any / (incidence * incidence)};
    for (int i = 0; i < N_AIR_DATA; i++) {
        const double variance = quadratic(N_STATES, row[i], covariance, row[i]) + added[i];
        std[i] = sqrt(variance > 0.0 ? variance : 0.0);
    }
    for (int i = AIR_PRESSURE; i <= AIR_DYNAMIC; i++) {
        std[i] = value[i] * lognormal_deviation(std[i] / value[i]);
    }
    std[WIND_ROLL_ANGLE] = clipped(std[WIND_ROLL_ANGLE], 0.0, PI / sqrt(3.0)); /* of a roll angle that may be any */
    set_flags(map, prior_std, solution, std[TOTAL_INCIDENCE], is_identified);
}

/* Loads in addition to the five over the flight state: rolling moment, section loads, hinge moments of a map with
   tables.

   Load j is a row of tables on the knots of strain, corrected by strain as the five are, and so are its errors (above):

       f_j = L_j(x) + Gamma_jd S^-1 r,
       var f_j = (J_j - K_j J) H_full^-1 (J_j - K_j J)' + Gamma_jj - K_j Gamma_dj + (f_j - f_full,j)^2.

   Only variances are put out, no covariances among these loads. Where air data do not give the pressure,
   policies/ambiguity.c has found factors on the standard deviations of the five loads; load j takes the factor of
   the load that it is stated to be like, the largest if it is like none. Other solutions of the sample
   (policies/ambiguity.c) at differences delta add part delta^2. Strain corrects all solutions alike, so that
   the tables alone differ. docs/explanation/nonlinear_estimator.md, "Lost gauges" and "Without q_inf and p_inf". */

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
    const FlightOtherLoadsMap *own_map = &other_loads->map;
    const Response *response = &other_loads->response;
    const double *full_turned = other_loads->full_turned + j * solver->n;
    const int is_moment = out->map.is_moment[j] > 0.0;
    const double reference = map_reference(solver->map, is_moment);
    const double scale = 1.0 / (pressure->dynamic * reference), turn = reference / own_reference(inputs, is_moment);
    double by_state[N_STATES], of_coefficient;
    const double load =
        flight_corrected(solver, solver->right, response, j, other_loads->turned + j * solver->n, by_state);
    const LoadErrors errors = flight_load_errors(solver, pressure, response, j, load, full_turned, scale);
    const double left = flight_load_square(solver, own_map->variance[j] + own_map->considered_variance[j], N_LOADS + j,
                                           N_LOADS + j, full_turned, full_turned);
    const double remaining = left > 0.0 ? left : 0.0; /* of a load that strain determines wholly, rounding leaves less */
    const double variance = covariance_of(solver, pressure, &errors, &errors, remaining, &of_coefficient);
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
        joined(of_other * turn * sqrt(of_coefficient), turn * turn * others[1]);
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
