#include "law_update.h"

#include <string.h>

#include "../numerics/products.h"

void transpose(size_t rows, size_t columns, const double *matrix, size_t row, double *out, size_t out_row) {
    for (size_t i = 0; i < rows; i++) {
        for (size_t j = 0; j < columns; j++) {
            out[j * out_row + i] = matrix[i * row + j];
        }
    }
}

void law_set_joseph(const Laws *laws, const Joseph *joseph, const Law *law, Law *after) {
    const size_t n = laws->n, order = laws->order, rows = joseph->rows;
    const int wide = laws->wide;
    double *first = joseph->square, *second = first + order * order, *kept = second + order * order;
    double *half = joseph->half, *covariance = after->covariance;
    for (size_t i = 0; i < n; i++) {
        for (size_t j = 0; j < order; j++) {
            const double taken = j < joseph->n_read ? joseph->read[i * order + j] : 0.0;
            kept[i * order + j] = (i == j ? 1.0 : 0.0) - taken;
        }
    }
    multiply(wide, FULL, n, rows, rows, by_rows(joseph->gain, rows), joseph->white, rows, half, rows);
    transpose(n, rows, joseph->gain, rows, joseph->turned, order);
    for (size_t k = 0; k < n * rows; k++) {
        half[k] *= 0.5;
    }
    subtract_product(wide, n, n, rows, by_rows(kept, order), joseph->considered, rows, half, rows);
    multiply(wide, FULL, n, rows, order, by_rows(half, rows), joseph->turned, order, second, order);
    multiply(wide, FULL, n, n, order, by_rows(kept, order), law->covariance, order, first, order);
    transpose(n, n, kept, order, joseph->turned, order);
    multiply(wide, FULL, n, n, order, by_rows(first, order), joseph->turned, order, covariance, order);
    for (size_t i = 0; i < n; i++) {
        memset(covariance + i * order + n, 0, (order - n) * sizeof *covariance);
        for (size_t j = 0; j <= i; j++) {
            const double sum = second[i * order + j] + second[j * order + i];
            const double both = covariance[i * order + j] + covariance[j * order + i];
            covariance[i * order + j] = covariance[j * order + i] = 0.5 * both + sum;
        }
    }
}

void law_update_zeros(const Laws *laws, const Joseph *joseph, const Law *law, Law *after) {
    const size_t n = laws->n, columns = laws->zeros.columns;
    if (!laws->zeros.in_use) {
        return;
    }
    memcpy(after->of_zeros, law->of_zeros, n * columns * sizeof *after->of_zeros);
    subtract_product(laws->wide, n, joseph->n_read, columns, by_rows(joseph->read, laws->order), law->of_zeros, columns,
                     after->of_zeros, columns);
    zero_errors_subtract(&laws->zeros, n, joseph->gain, joseph->rows, after->of_zeros);
}
