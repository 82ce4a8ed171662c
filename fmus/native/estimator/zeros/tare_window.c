/* Readings of a window in few numbers: sums over stretches of equal length, so that a window of any length takes the
   same memory.

   Of each gauge: x_0, its first reading; the sum of (x - x_0)^2 over all; sums of x - x_0 and numbers of readings by
   stretch. When MAX_STRETCHES = 32 are full, neighbours are joined to 16 of twice the length. About x_0, no digit is
   lost where a zero is 10^5 times the noise:

       mean = x_0 + T / c,      scatter^2 = (Q - T^2 / c) / (n - 1),      stretch = (T_k + missing T / c) / L,

   T the sum, Q the sum of squares, c the number of readings of the gauge among n. A stretch with missing readings
   has the mean in their place. docs/howto/tare.md, "What the uncertainty includes". */

#include "tare_window.h"

#include <math.h>
#include <string.h>

#define LARGEST_COUNT 9007199254740992.0 /* 2^53, up to which every whole number is a double */

size_t window_doubles(size_t n_gauges) {
    return (2 + 2 * MAX_STRETCHES) * n_gauges;
}

void window_arrays(TareWindow *window, size_t n_gauges, double *doubles) {
    window->n_gauges = n_gauges;
    window->first = doubles;
    window->square = window->first + n_gauges;
    window->total = window->square + n_gauges;
    window->count = window->total + MAX_STRETCHES * n_gauges;
}

void window_begin(TareWindow *window) {
    window->counts = (WindowCounts){.length = 1.0};
    memset(window->first, 0, window_doubles(window->n_gauges) * sizeof *window->first);
}

/* Stretches 2 k and 2 k + 1 become stretch k, of twice the length. */
static void join_stretches(TareWindow *window) {
    const size_t n = window->n_gauges;
    double *const table[] = {window->total, window->count};
    for (size_t t = 0; t < 2; t++) {
        for (size_t k = 0; k < LEAST_STRETCHES; k++) {
            for (size_t i = 0; i < n; i++) {
                table[t][k * n + i] = table[t][2 * k * n + i] + table[t][(2 * k + 1) * n + i];
            }
        }
        memset(table[t] + LEAST_STRETCHES * n, 0, LEAST_STRETCHES * n * sizeof *table[t]);
    }
    window->counts.length *= 2.0;
    window->counts.stretches = LEAST_STRETCHES;
}

static double sum_of(const double *table, size_t rows, size_t n, size_t column) {
    double sum = 0.0;
    for (size_t k = 0; k < rows; k++) {
        sum += table[k * n + column];
    }
    return sum;
}

void window_add(TareWindow *window, const double *strain) {
    WindowCounts *counts = &window->counts;
    const size_t n = window->n_gauges, row = (size_t)counts->stretches * n;
    for (size_t i = 0; i < n; i++) {
        if (!isfinite(strain[i])) {
            continue;
        }
        if (window->count[row + i] == 0.0 && sum_of(window->count, MAX_STRETCHES, n, i) == 0.0) {
            window->first[i] = strain[i];
        }
        const double part = strain[i] - window->first[i];
        window->square[i] += part * part;
        window->total[row + i] += part;
        window->count[row + i] += 1.0;
    }
    counts->samples += 1.0;
    counts->filled += 1.0;
    if (counts->filled == counts->length) {
        counts->filled = 0.0;
        counts->stretches += 1.0;
        if (counts->stretches == MAX_STRETCHES) {
            join_stretches(window);
        }
    }
}

static int whole(double value, double least, double largest) {
    return value >= least && value <= largest && value == (double)(long long)value;
}

int window_counts_fit(const WindowCounts *counts) {
    return whole(counts->length, 1.0, LARGEST_COUNT) && whole(counts->stretches, 0.0, MAX_STRETCHES - 1.0)
        && whole(counts->filled, 0.0, counts->length - 1.0)
        && counts->samples == counts->stretches * counts->length + counts->filled;
}

/* Statistics of the gauges that read in a large enough part of the window; an even number of stretches, as
   tare_judge.c joins them in pairs. */
void window_statistics(const TareWindow *window, double least_part, WindowStatistics *statistics) {
    const size_t n = window->n_gauges;
    const double samples = window->counts.samples, length = window->counts.length;
    statistics->n_stretches = (size_t)window->counts.stretches & ~(size_t)1;
    for (size_t i = 0; i < n; i++) {
        const double count = sum_of(window->count, MAX_STRETCHES, n, i);
        const double total = sum_of(window->total, MAX_STRETCHES, n, i);
        statistics->reads[i] = count >= least_part * samples;
        const double mean = statistics->reads[i] ? total / count : 0.0, square = window->square[i] - mean * total;
        statistics->mean[i] = statistics->reads[i] ? window->first[i] + mean : 0.0;
        statistics->scatter[i] = statistics->reads[i] && square > 0.0 ? sqrt(square / (samples - 1.0)) : 0.0;
        for (size_t k = 0; k < statistics->n_stretches; k++) {
            const double missing = length - window->count[k * n + i];
            const double stretch = (window->total[k * n + i] + missing * mean) / length;
            statistics->stretch[k * n + i] = statistics->reads[i] ? stretch : 0.0;
        }
    }
}
