/* US Standard Atmosphere 1976 over the geopotential altitude, in closed form: strainfmu/atmosphere.py, which makes the
   table of its layers. */

#ifndef ATMOSPHERE_H
#define ATMOSPHERE_H

#include <stddef.h>

#define LAYER_SIZE 5 /* base and top [m], gradient [K/m]; pressure [Pa] and temperature [K] at the base */

typedef struct {
    size_t n_layers;
    const double *layer; /* (n_layers, LAYER_SIZE) upwards, each from the top of the one below it on */
} Atmosphere;

/* Pressure [Pa] and temperature [K] at an altitude [m]. 1; 0 outside the layers, and for NaN. */
int atmosphere_at(const Atmosphere *atmosphere, double altitude, double *pressure, double *temperature);

#endif
