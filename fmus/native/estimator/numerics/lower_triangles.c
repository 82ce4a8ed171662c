#include "lower_triangles.h"

#include <math.h>

#include "triangles.h"

/* Rows and columns scaled to unit variance, so that gauges of unlike noise cost no digits. */
int lower_root(size_t n, const double *covariance, double *root, double *inverse) {
    for (size_t i = 0; i < n; i++) {
        double *row = root + triangle_column(i);
        const double own = covariance[i * n + i];
        if (!(own > 0.0)) {
            return 0;
        }
        const double size = sqrt(own);
        for (size_t j = 0; j <= i; j++) {
            const double other = sqrt(covariance[j * n + j]);
            const double rest = covariance[i * n + j] / (size * other) - dot(j, row, root + triangle_column(j));
            if (j < i) {
                row[j] = rest / root[triangle_column(j) + j];
            } else if (rest > 0.0) {
                row[i] = sqrt(rest);
            } else {
                return 0;
            }
        }
    }
    for (size_t i = 0; i < n; i++) {
        const double *row = root + triangle_column(i);
        double *solved = inverse + triangle_column(i);
        for (size_t j = 0; j < i; j++) {
            double sum = 0.0;
            for (size_t k = j; k < i; k++) {
                sum += row[k] * inverse[triangle_column(k) + j];
            }
            solved[j] = -sum / row[i];
        }
        solved[i] = 1.0 / row[i];
    }
    for (size_t i = 0; i < n; i++) {
        const double size = sqrt(covariance[i * n + i]);
        for (size_t j = 0; j <= i; j++) {
            root[triangle_column(i) + j] *= size;
            inverse[triangle_column(i) + j] /= sqrt(covariance[j * n + j]);
        }
    }
    return 1;
}
