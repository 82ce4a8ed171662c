/* Scales of coefficients, and outputs that are not known. C = F / (q S) for forces, M / (q S L) for moments. Unknown
   outputs are NaN except counts and health, which always have a value. */

#include "outputs.h"

#include <math.h>

void coefficient_scales(double pressure, double area, double length, double *scale) {
    scale[0] = scale[1] = scale[2] = 1.0 / (pressure * area);
    scale[3] = scale[4] = 1.0 / (pressure * (area * length));
}

void set_unknown_from(double *output, int first, int end) {
    for (int i = first; i < end; i++) {
        output[i] = NAN;
    }
}

void set_unknown(double *output) {
    set_unknown_from(output, COEFFICIENTS, HEALTH_STATE);
    set_unknown_from(output, CHI_SQUARE, VALID_GAUGES);
    output[ENVELOPE_SCORE] = NAN;
}

