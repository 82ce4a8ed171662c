/* Strain and coefficients of a vehicle of revolution over its envelope: strainfmu/cosim/models/flight_model.py in C. */

#ifndef FLIGHT_MODEL_H
#define FLIGHT_MODEL_H

#include <stddef.h>

#include "../core/atmosphere.h"

#define N_COEFFICIENTS 5 /* C_A, C_N, C_Y, M_P, M_Y */

typedef struct {
    size_t n_gauges, n_mach, n_incidence, n_channel, n_harmonic;
    int vented;                                          /* 1: the inside is at the ambient pressure */
    double internal_pressure, base_area;                 /* [Pa], [m2] */
    double reference_area, reference_length;             /* [m2], [m] */
    const double *mach_knots, *incidence_knots;          /* [1], [rad] */
    const double *gauge_cosine, *gauge_sine;             /* (n_gauges) of the roll angles */
    const double *gauge_channel;                         /* (n_gauges) indices in strain_table */
    const double *strain_of_internal_pressure;           /* (n_gauges) [1/Pa] */
    const double *apparent_strain;                       /* (n_gauges) [1] */
    const double *noise_scale;                           /* (n_gauges) noise of a row over the noise of a gauge */
    const double *coefficient_table, *strain_table;      /* as in flight_model.py, row by row */
    Atmosphere atmosphere;
} FlightModel;

typedef struct {
    double mach_number, angle_of_attack, sideslip_angle, altitude; /* [1], [rad], [rad], [m] */
} FlightCondition;

/* What a condition gives before strains are computed. */
typedef struct {
    double coefficient[N_COEFFICIENTS];
    double dynamic_pressure, speed_of_sound, ambient_pressure; /* [Pa], [m/s], [Pa] */
    double leeward_cosine, leeward_sine;                       /* of the roll angle of the leeward meridian */
    size_t cell;                                               /* of the tables */
    double weight[16];
} FlightPoint;

/* Take a model from doubles that begin with its sizes; the number taken, 0 if they do not fit into count. */
size_t flight_model_take(FlightModel *model, const double *data, size_t count);

/* Number of doubles of workspace that flight_strains needs. */
size_t flight_model_work(const FlightModel *model);

/* 1, or 0 outside the envelope, where the point is NaN. */
int flight_point(const FlightModel *model, const FlightCondition *condition, FlightPoint *point);

/* Strains (n_gauges) [1] without noise. */
void flight_strains(const FlightModel *model, const FlightPoint *point, double *work, double *strain);

#endif
