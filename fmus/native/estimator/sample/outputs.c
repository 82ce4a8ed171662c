/* Scales of coefficients, and outputs that are not known. C = F / (q S) for forces, M / (q S L) for moments. Unknown
   loads and coefficients are NaN; counts, health and the tests of the residual always have a value. */

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

void set_unknown(double *output, double chi_square_limit) {
    set_unknown_from(output, COEFFICIENTS, HEALTH_STATE);
    output[CHI_SQUARE] = output[ENVELOPE_SCORE] = 0.0;
    output[CHI_SQUARE_LIMIT] = chi_square_limit;
}

