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

#include "flight_air_data.h"

#include <math.h>

#include "../../core/elementary.h"
#include "../numerics/cholesky.h"
#include "flight_loads.h"

static const double PI = 3.1415926535897931;

static double signed_angle(double y, double x) {
    return y < 0.0 ? -angle_of(-y, x) : angle_of(y, x);
}

static double smaller(double a, double b) {
    return b < a ? b : a;
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
    std[WIND_ROLL_ANGLE] = smaller(std[WIND_ROLL_ANGLE], PI / sqrt(3.0)); /* of a roll angle that may be any */
    set_flags(map, prior_std, solution, std[TOTAL_INCIDENCE], is_identified);
}
