/* Temperature and inertia at run time: their strain, subtracted from the readings as far as sensors measure it. Parts
   "thermal" and "inertia" of resources/map.bin: in a map with masses the last sensors are the channels of an inertial unit. */

#ifndef THERMAL_H
#define THERMAL_H

#include "../map/map.h"

/* Modes of n_gauges gauges; arrays point into the bytes of the file. */
typedef struct {
    MAP_MEMBERS(THERMAL)
    MAP_MEMBERS(INERTIA) /* 0 without masses */
    MAP_MEMBERS(VEHICLE) /* 0 where it is not stated */
} ThermalMap;

typedef struct {
    int present; /* whether the map has modes; if not, nothing else is set */
    int wide;
    size_t n_gauges;
    ThermalMap map;
    unsigned char *known; /* (n_sensors) the sensors that the matrices are for */
    int some;             /* whether there are any, or the vibration is known; if not, nothing is taken off */
    double vibration;     /* that the matrices are for, over prior_std of its modes; 1 where it is not known */
    int knows_vibration;  /* whether it is known */
    double *gain;         /* (2 n_gauges, n_sensors) strain, then temperature of the gauges per rise, in panels */
    double *own, *noise;  /* (n_gauges, n_gauges) covariances of the gauges, and with the errors that scale */
    double *rise;         /* (n_sensors) of the sensors, 0 of those not known [K] */
    double *of_gauge;     /* (2 n_gauges) strain and rise of the gauges by the sensors, */
    double *factor;       /* (n_gauges) and from them what a reading is multiplied with, */
    double *offset;       /* (n_gauges) and what is taken off then */
    int outdated;         /* whether of_gauge, factor and offset are of other readings */
    double *information;  /* (n_modes, n_modes) of the amplitudes by prior and known sensors, amplitudes over prior_std, */
    double *amplitude;    /* (n_modes, n_sensors) and the amplitudes per rise [1] */
    double *scratch;
} Thermal;

/* Read the part, if there is one, and allocate. 1; 0 after a message. */
int thermal_create(MapFile *file, size_t n_gauges, int wide, Thermal *thermal);

/* Take the readings of the sensors [K], of the channels, and the vibration, NaN of those not known. Whether others are known than before: then thermal_renew comes next. */
int thermal_read(Thermal *thermal, const double *temperature, const double *channel, double vibration);

/* Use the vibration of a state, over prior_std of its modes, 0 for none known; whether matrices were for another. Whether
   a number is one. */
int thermal_set_vibration(Thermal *thermal, double vibration);
int thermal_is_vibration(double vibration);

/* Whether there is more vibration than the map states without knowing it. */
int thermal_vibrates(const Thermal *thermal);

/* 1 or 2 where the specific force along y or z is known and contradicts the lateral force of the vehicle's mass: loads and
   their standard deviations [N] are axial, normal, side, and `limit` is of chi-square with one degree of freedom. Otherwise 0. */
int thermal_contradicted(const Thermal *thermal, const double *loads, const double *loads_std, double limit);

/* Make gain and covariances for the known sensors. */
void thermal_renew(Thermal *thermal);

/* Bring strains less zeros (n_gauges) to the reference temperature. */
void thermal_correct(Thermal *thermal, double *strain);

#endif
