#include "triangles.h"

#include <math.h>

/* Four columns at a time: y is loaded and stored once for four products, and each y[i] still gathers its columns from
   left to right, so that the width of vector registers does not change a bit. */
void triangle_times(size_t n, const double *restrict upper, const double *restrict x, double *restrict y) {
    for (size_t i = 0; i < n; i++) {
        y[i] = 0.0;
    }
    size_t j = 0;
    for (; j + 4 <= n; j += 4) {
        const double *restrict c0 = upper + triangle_column(j);
        const double *restrict c1 = c0 + j + 1;
        const double *restrict c2 = c1 + j + 2;
        const double *restrict c3 = c2 + j + 3;
        const double x0 = x[j], x1 = x[j + 1], x2 = x[j + 2], x3 = x[j + 3];
        for (size_t i = 0; i <= j; i++) {
            y[i] = (((y[i] + c0[i] * x0) + c1[i] * x1) + c2[i] * x2) + c3[i] * x3;
        }
        y[j + 1] = ((y[j + 1] + c1[j + 1] * x1) + c2[j + 1] * x2) + c3[j + 1] * x3;
        y[j + 2] = (y[j + 2] + c2[j + 2] * x2) + c3[j + 2] * x3;
        y[j + 3] = y[j + 3] + c3[j + 3] * x3;
    }
    for (; j < n; j++) {
        const double *restrict column = upper + triangle_column(j);
        for (size_t i = 0; i <= j; i++) {
            y[i] += column[i] * x[j];
        }
    }
}

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

/* As triangle_times, with four rows at a time. */
void triangle_transposed_times(size_t n, const double *restrict rows, const double *restrict x, double *restrict y) {
    for (size_t j = 0; j < n; j++) {
        y[j] = 0.0;
    }
    size_t i = 0;
    for (; i + 4 <= n; i += 4) {
        const double *restrict r0 = rows + triangle_row(n, i) - i; /* element j of each is that of column j */
        const double *restrict r1 = r0 + n - i - 1;
        const double *restrict r2 = r1 + n - i - 2;
        const double *restrict r3 = r2 + n - i - 3;
        const double x0 = x[i], x1 = x[i + 1], x2 = x[i + 2], x3 = x[i + 3];
        y[i] += r0[i] * x0;
        y[i + 1] = (y[i + 1] + r0[i + 1] * x0) + r1[i + 1] * x1;
        y[i + 2] = ((y[i + 2] + r0[i + 2] * x0) + r1[i + 2] * x1) + r2[i + 2] * x2;
        for (size_t j = i + 3; j < n; j++) {
            y[j] = (((y[j] + r0[j] * x0) + r1[j] * x1) + r2[j] * x2) + r3[j] * x3;
        }
    }
    for (; i < n; i++) {
        const double *restrict row = rows + triangle_row(n, i) - i;
        for (size_t j = i; j < n; j++) {
            y[j] += row[j] * x[i];
        }
    }
}

void triangle_rows(size_t n, const double *upper, double *rows) {
    for (size_t i = 0; i < n; i++) {
        for (size_t j = i; j < n; j++) {
            *rows++ = upper[triangle_column(j) + i];
        }
    }
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
            const double share = factor * dot(length, v, column);
            for (size_t i = 0; i < length; i++) {
                column[i] -= share * v[i];
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
