#include "tare_judge.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#define MICRO 1e6 /* of strain, in messages */
#define LEAST_LIKE_LOAD 8 /* gauges, below which strain has no pattern */

/* Arrays (n_gauges) in the scratch: fine is the variance of the means of stretches over that of independent readings,
   coarse the same of pairs of them; then rises over the window, and deviations of the zeros; then rows for sorting. */
typedef struct {
    double *fine, *coarse, *rise, *std, *sorted;
} Judgement;

size_t judge_doubles(size_t n_gauges) {
    return 5 * n_gauges;
}

/* The middle one of `count` numbers, in an order of their own afterwards; the mean of two of an even number. */
static double median(double *values, size_t count) {
    for (size_t i = 1; i < count; i++) {
        const double value = values[i];
        size_t k = i;
        for (; k > 0 && values[k - 1] > value; k--) {
            values[k] = values[k - 1];
        }
        values[k] = value;
    }
    return count % 2 ? values[count / 2] : 0.5 * (values[count / 2 - 1] + values[count / 2]);
}

/* A straight line through the means of stretches of a gauge, `join` (1 or 2) of them taken together: its slope per
   stretch, and the sum of squares about it. */
static double about_line(const WindowStatistics *found, size_t n, size_t gauge, size_t join, double *slope) {
    const size_t count = found->n_stretches / join;
    double mean = 0.0, of_place = 0.0, square = 0.0, means[MAX_STRETCHES];
    *slope = 0.0;
    for (size_t k = 0; k < count; k++) {
        const double *row = found->stretch + k * join * n + gauge;
        means[k] = join == 1 ? row[0] : 0.5 * (row[0] + row[n]);
        mean += means[k];
    }
    mean /= (double)count;
    for (size_t k = 0; k < count; k++) {
        const double place = (double)k - 0.5 * (double)(count - 1);
        *slope += place * means[k];
        of_place += place * place;
    }
    *slope /= of_place;
    for (size_t k = 0; k < count; k++) {
        const double place = (double)k - 0.5 * (double)(count - 1);
        const double rest = means[k] - mean - place * *slope;
        square += rest * rest;
    }
    return square;
}

/* Deviations and rises of the zeros. */
static void set_deviations(Tare *tare, const Judgement *j) {
    const WindowStatistics *found = &tare->found;
    const size_t n = tare->n_gauges, b = found->n_stretches;
    const double samples = tare->window.counts.samples, length = tare->window.counts.length;
    double places = 0.0, sum = 0.0, sum_fine = 0.0, all = 1.0;
    size_t moving = 0, alike = 0;
    for (size_t k = 0; k < b; k++) {
        const double place = ((double)k - 0.5 * (double)(b - 1)) * length / samples;
        places += place * place;
    }
    for (size_t i = 0; i < n; i++) {
        double slope, coarse_slope;
        const double square = about_line(found, n, i, 1, &slope), coarse = about_line(found, n, i, 2, &coarse_slope);
        const double variance = found->scatter[i] * found->scatter[i];
        const double rise = slope * samples / length, rise_std = sqrt(square / (double)(b - 2) / places);
        j->rise[i] = fabs(rise) > tare->limits.moved * rise_std ? rise : 0.0;
        if (found->scatter[i] > 0.0) {
            j->fine[i] = square / (double)(b - 2) * length / variance;
            j->coarse[i] = coarse / (double)(b / 2 - 2) * 2.0 * length / variance;
            j->sorted[moving++] = j->fine[i];
        }
    }
    const double times = tare->limits.own_factor * tare->limits.own_factor;
    const double limit = moving > 0 ? times * median(j->sorted, moving) : 0.0;
    for (size_t i = 0; i < n; i++) {
        if (found->scatter[i] > 0.0 && j->fine[i] <= limit) {
            sum += 2.0 * j->coarse[i] - j->fine[i];
            sum_fine += j->fine[i];
            alike++;
        }
    }
    if (alike > 0) {
        const double mean = sum / (double)alike, mean_fine = sum_fine / (double)alike;
        all = mean > mean_fine ? mean : mean_fine;
        all = all > 1.0 ? all : 1.0;
    }
    for (size_t i = 0; i < n; i++) {
        const double own = found->scatter[i] > 0.0 && j->fine[i] > limit && j->fine[i] > all ? j->fine[i] : all;
        const double of_known = tare->limits.known_std[i] * tare->limits.known_std[i];
        j->std[i] =
            sqrt(own * found->scatter[i] * found->scatter[i] / samples + j->rise[i] * j->rise[i] / 12.0 + of_known);
    }
}

/* Deviation of the mean over the window of what all gauges that read have in common. */
static double common_std(const WindowStatistics *found, size_t n, size_t n_reading) {
    const size_t b = found->n_stretches;
    const double freedom = (double)(b - 2), count = (double)n_reading;
    double of_sums = 0.0, of_each = 0.0, sums[MAX_STRETCHES] = {0.0}, mean = 0.0, slope = 0.0, places = 0.0;
    if (n_reading < 2) {
        return 0.0;
    }
    for (size_t i = 0; i < n; i++) { /* those that do not read are 0 */
        of_each += about_line(found, n, i, 1, &slope);
        for (size_t k = 0; k < b; k++) {
            sums[k] += found->stretch[k * n + i];
        }
    }
    slope = 0.0;
    for (size_t k = 0; k < b; k++) {
        const double place = (double)k - 0.5 * (double)(b - 1);
        mean += sums[k] / (double)b;
        slope += place * sums[k];
        places += place * place;
    }
    for (size_t k = 0; k < b; k++) {
        const double rest = sums[k] - mean - ((double)k - 0.5 * (double)(b - 1)) * slope / places;
        of_sums += rest * rest;
    }
    const double shared = (of_sums - of_each) / (freedom * count * (count - 1.0));
    const double chance = of_each / (freedom * count) * sqrt(2.0 / freedom) / count * 3.0;
    return shared > chance ? sqrt(shared / (double)b) : 0.0;
}

static size_t largest_of(const double *values, size_t n) {
    size_t worst = 0;
    for (size_t i = 1; i < n; i++) {
        worst = fabs(values[i]) > fabs(values[worst]) ? i : worst;
    }
    return worst;
}

static int drifts(const Tare *tare, const double *rise, char *text) {
    const size_t worst = largest_of(rise, tare->n_gauges);
    if (fabs(rise[worst]) <= tare->limits.drift) {
        return 0;
    }
    snprintf(text, MODEL_TEXT_SIZE, "readings drift: gauge %lu by %.3g um/m over the window, expected at most %g um/m",
             (unsigned long)(worst + 1), MICRO * rise[worst], MICRO * tare->limits.drift);
    return 1;
}

static int moves(const Tare *tare, char *text) {
    const double *scatter = tare->found.scatter, *noise = tare->limits.noise_std;
    size_t worst = 0;
    for (size_t i = 1; i < tare->n_gauges; i++) {
        worst = scatter[i] / noise[i] > scatter[worst] / noise[worst] ? i : worst;
    }
    if (scatter[worst] <= tare->limits.loud * noise[worst]) {
        return 0;
    }
    snprintf(text, MODEL_TEXT_SIZE,
             "readings move: gauge %lu by %.3g um/m rms, expected at most %g times its noise of %.3g um/m",
             (unsigned long)(worst + 1), MICRO * scatter[worst], tare->limits.loud, MICRO * noise[worst]);
    return 1;
}

static int too_large(const Tare *tare, char *text) {
    const double *value = tare->found.mean;
    const size_t worst = largest_of(value, tare->n_gauges);
    if (fabs(value[worst]) <= tare->limits.zero) {
        return 0;
    }
    snprintf(text, MODEL_TEXT_SIZE, "no plausible zero: gauge %lu reads %.4g um/m, expected at most %g um/m",
             (unsigned long)(worst + 1), MICRO * value[worst], MICRO * tare->limits.zero);
    return 1;
}

/* Zeros are random from gauge to gauge; the strain of a flight has a pattern. */
static int looks_like_load(const Tare *tare, const double *mean_strain, size_t n_reading, double *sorted, char *text) {
    const double *value = tare->found.mean;
    double along = 0.0, size = 0.0, square = 0.0;
    for (size_t i = 0; i < tare->n_gauges; i++) { /* those that do not read are 0 in value alone */
        along += value[i] * mean_strain[i];
        square += value[i] * value[i];
        size += tare->found.reads[i] ? mean_strain[i] * mean_strain[i] : 0.0;
    }
    if (n_reading < LEAST_LIKE_LOAD || !(size > 0.0)) {
        return 0;
    }
    const double part = along / sqrt(size), left = square - part * part;
    const double rest = sqrt((left > 0.0 ? left : 0.0) / (double)(n_reading - 1));
    memcpy(sorted, tare->limits.noise_std, tare->n_gauges * sizeof *sorted);
    const double noise = median(sorted, tare->n_gauges);
    const double limit = tare->limits.like_load * (rest > noise ? rest : noise);
    if (fabs(part) <= limit) {
        return 0;
    }
    snprintf(text, MODEL_TEXT_SIZE,
             "readings look like load: %.3g um/m of them lie along the strain of the mean flight, expected at most "
             "%.3g um/m of random zeros",
             MICRO * fabs(part), MICRO * limit);
    return 1;
}

int tare_judge(Tare *tare, const double *mean_strain, char text[MODEL_TEXT_SIZE]) {
    const size_t n = tare->n_gauges;
    const WindowStatistics *found = &tare->found;
    const Judgement j = {tare->scratch, tare->scratch + n, tare->scratch + 2 * n, tare->scratch + 3 * n,
                         tare->scratch + 4 * n};
    size_t n_reading = 0, n_known = 0;
    set_deviations(tare, &j);
    for (size_t i = 0; i < n; i++) {
        n_reading += found->reads[i];
        n_known += found->reads[i] && j.std[i] < tare->largest_zero;
        found->mean[i] -= found->reads[i] ? tare->limits.known[i] : 0.0;
    }
    if (drifts(tare, j.rise, text) || moves(tare, text) || too_large(tare, text)
        || looks_like_load(tare, mean_strain, n_reading, j.sorted, text)) {
        return 0;
    }
    if ((double)n_known < tare->limits.least_gauges * (double)n) {
        snprintf(text, MODEL_TEXT_SIZE, "%lu of %lu gauges read", (unsigned long)n_known, (unsigned long)n);
        return 0;
    }
    for (size_t i = 0; i < n; i++) {
        const int bounded = j.std[i] < tare->largest_zero;
        tare->zero[i] = found->mean[i];
        tare->zero[n + i] = found->reads[i] && bounded ? j.std[i] : tare->largest_zero;
    }
    tare->zero[2 * n] = common_std(found, n, n_reading);
    return 1;
}
