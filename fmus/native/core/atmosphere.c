/* US Standard Atmosphere 1976 over the geopotential altitude h, layer by layer in closed form.

   In a layer with base h_b, T_b, p_b and the temperature gradient l, with rise = h - h_b, gravity g and gas constant
   R,

       T = T_b + l rise,      p = p_b (T / T_b)^(-g / (R l)),      p = p_b e^(-g rise / (R T_b)) where l = 0.

   The layers come with the resource of an FMU, so that C and Python (strainfmu/atmosphere.py) have one table.
   docs/explanation/envelope.md, "What is compared", uses p(h). */

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
