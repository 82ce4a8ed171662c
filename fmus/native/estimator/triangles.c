#include "triangles.h"

#include <math.h>

/* Four sums, so that additions need not wait for each other. */
double dot(size_t n, const double *restrict x, const double *restrict y) {
    double a = 0.0, b = 0.0, c = 0.0, d = 0.0;
    size_t i = 0;
    for (; i + 4 <= n; i += 4) {
        a += x[i] * y[i];
        b += x[i + 1] * y[i + 1];
        c += x[i + 2] * y[i + 2];
        d += x[i + 3] * y[i + 3];
    }
    double sum = (a + b) + (c + d);
    for (; i < n; i++) {
        sum += x[i] * y[i];
    }
    return sum;
}

void householder_triangle(size_t rows, size_t columns, double *a) {
    const size_t steps = rows < columns ? rows : columns;
    for (size_t k = 0; k < steps; k++) {
        double *restrict v = a + k * rows + k;
        const size_t length = rows - k;
        const double norm = sqrt(dot(length, v, v));
        if (!(norm > 0.0)) {
            continue;
        }
        const double head = v[0];
        const double diagonal = head > 0.0 ? -norm : norm;
        const double factor = 1.0 / (norm * (norm + fabs(head)));
        v[0] = head - diagonal;
        for (size_t j = k + 1; j < columns; j++) {
            double *restrict column = a + j * rows + k;
            const double projection = factor * dot(length, v, column);
            for (size_t i = 0; i < length; i++) {
                column[i] -= projection * v[i];
            }
        }
        v[0] = diagonal;
    }
}

/* Sweeps of Jacobi rotations; ten are plenty for matrices of any size seen, the bound is for damaged ones. */
#define LARGEST_SWEEPS 30

double smallest_singular_value(size_t n, double *a) {
    const double orthogonal = 1e-15;
    int rotated = 1;
    for (int sweep = 0; rotated && sweep < LARGEST_SWEEPS; sweep++) {
        rotated = 0;
        for (size_t p = 0; p + 1 < n; p++) {
            for (size_t q = p + 1; q < n; q++) {
                double *restrict left = a + p * n, *restrict right = a + q * n;
                const double alpha = dot(n, left, left), beta = dot(n, right, right), gamma = dot(n, left, right);
                if (!(fabs(gamma) > orthogonal * sqrt(alpha) * sqrt(beta))) {
                    continue;
                }
                rotated = 1;
                const double zeta = (beta - alpha) / (2.0 * gamma);
                const double size = 1.0 / (fabs(zeta) + sqrt(1.0 + zeta * zeta));
                const double tangent = zeta > 0.0 ? size : -size;
                const double cosine = 1.0 / sqrt(1.0 + tangent * tangent), sine = cosine * tangent;
                for (size_t i = 0; i < n; i++) {
                    const double kept = left[i];
                    left[i] = cosine * kept - sine * right[i];
                    right[i] = sine * kept + cosine * right[i];
                }
            }
        }
    }
    double smallest = INFINITY;
    for (size_t j = 0; j < n; j++) {
        const double size = sqrt(dot(n, a + j * n, a + j * n));
        smallest = size < smallest ? size : smallest;
    }
    return smallest;
}
