#include "atmosphere.h"

#include "elementary.h"

enum { BASE, TOP, GRADIENT, BASE_PRESSURE, BASE_TEMPERATURE };

static const double GRAVITY = 9.80665, GAS_CONSTANT = 287.053;

int atmosphere_at(const Atmosphere *atmosphere, double altitude, double *pressure, double *temperature) {
    for (size_t k = 0; k < atmosphere->n_layers; k++) {
        const double *layer = atmosphere->layer + k * LAYER_SIZE;
        if (!(altitude >= layer[BASE] && altitude <= layer[TOP])) {
            continue;
        }
        const double rise = altitude - layer[BASE], gradient = layer[GRADIENT];
        *temperature = layer[BASE_TEMPERATURE] + gradient * rise;
        const double exponent =
            gradient == 0.0
                ? -GRAVITY * rise / (GAS_CONSTANT * layer[BASE_TEMPERATURE])
                : -GRAVITY / (GAS_CONSTANT * gradient) * logarithm(*temperature / layer[BASE_TEMPERATURE]);
        *pressure = layer[BASE_PRESSURE] * exponential(exponent);
        return 1;
    }
    return 0;
}
