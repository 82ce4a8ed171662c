/* Zero offsets that a window of readings gives, their standard deviations, and what speaks against them.

   n readings of each gauge in B stretches of L readings (below), scatter s of one reading. The zero is the
   mean less the strain of known loads. Its variance is, with a factor k for readings that depend on each other,

       std^2 = k s^2 / n + rise^2 / 12 + known_std^2.

   k compares the scatter of means of stretches about a straight line, v_L, with independent readings: fine = v_L L /
   s^2, and coarse is the same of stretches twice as long. Both fall short by a term in proportion to 1 / L, so that
   2 coarse - fine is free of it (batch means: Alexopoulos and Seila, Handbook of Simulation, 1998, ch. 7). It is
   averaged over the gauges, as channels have their filters in common, without those far above the median; these have
   their own. k is at least 1. rise is the slope of the line over the window where it exceeds `moved` of its standard
   deviations; the mean of a drift is off by its part of an even distribution, rise^2 / 12.

   What the means of all m gauges have in common has the variance

       shared = (sum of squares of the sums over gauges - sum of squares of each) / ((B - 2) m (m - 1)),

   over B for the mean of the window; below three standard deviations of chance it is 0. Against the zeros speak a
   drift, a scatter above the noise of the gauge, a size that is no zero, too few gauges, and a pattern of load:
   zeros are random from gauge to gauge, strain of flights lies along the first patterns. With patterns made
   orthonormal over the gauges that read, the sum of squares along them may exceed the rest by load_odds at most.
   docs/howto/tare.md, "What the uncertainty includes" and "When it is refused". */

#include "zeros.h"

#include <math.h>
#include <string.h>

/* Readings of a window in few numbers: sums over stretches of equal length, so that a window of any length takes the
   same memory.

   Of each gauge: x_0, its first reading; the sum of (x - x_0)^2 over all; sums of x - x_0 and numbers of readings by
   stretch. When MAX_STRETCHES = 32 are full, neighbours are joined to 16 of twice the length. About x_0, no digit is
   lost where a zero is 10^5 times the noise:

       mean = x_0 + T / c,      scatter^2 = (Q - T^2 / c) / (n - 1),      stretch = (T_k + missing T / c) / L,

   T the sum, Q the sum of squares, c the number of readings of the gauge among n. A stretch with missing readings
   has the mean in their place. docs/howto/tare.md, "What the uncertainty includes". */

#define LARGEST_COUNT 9007199254740992.0 /* 2^53, up to which every whole number is a double */

size_t window_doubles(size_t n_gauges) {
    return (2 + 2 * MAX_STRETCHES) * n_gauges;
}

void window_arrays(TareWindow *window, size_t n_gauges, Room *room) {
    window->n_gauges = n_gauges;
    TAKE(room, n_gauges, &window->first, &window->square);
    TAKE(room, MAX_STRETCHES * n_gauges, &window->total, &window->count);
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

#define LEAST_OWN_PART 1e-12 /* of the square of a pattern, that the patterns before do not make up */

/* Arrays (n_gauges) in the scratch: fine is the variance of the means of stretches over the variance of independent readings,
   coarse the same of pairs of them; then rises over the window, and sigmas of the zeros; then rows for sorting, and the directions
   (n_patterns, n_gauges) of loads. */
typedef struct {
    double *fine, *coarse, *rise, *std, *sorted, *direction;
} Judgement;

size_t judge_doubles(size_t n_gauges, size_t n_patterns) {
    return (5 + n_patterns) * n_gauges;
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

/* A straight line through values: its slope from one to the next, and the sum of squares about it. */
static double about_line(size_t count, const double *value, double *slope) {
    double mean = 0.0, of_place = 0.0, square = 0.0;
    *slope = 0.0;
    for (size_t k = 0; k < count; k++) {
        const double place = (double)k - 0.5 * (double)(count - 1);
        mean += value[k];
        *slope += place * value[k];
        of_place += place * place;
    }
    mean /= (double)count;
    *slope /= of_place;
    for (size_t k = 0; k < count; k++) {
        const double place = (double)k - 0.5 * (double)(count - 1);
        const double rest = value[k] - mean - place * *slope;
        square += rest * rest;
    }
    return square;
}

/* The same of the means of stretches of a gauge, `join` (1 or 2) stretches taken together. */
static double means_about_line(const WindowStatistics *statistics, size_t n, size_t gauge, size_t join, double *slope) {
    double means[MAX_STRETCHES] = {0.0};
    for (size_t k = 0; k < statistics->n_stretches / join; k++) {
        const double *row = statistics->stretch + k * join * n + gauge;
        means[k] = join == 1 ? row[0] : 0.5 * (row[0] + row[n]);
    }
    return about_line(statistics->n_stretches / join, means, slope);
}

/* k, and standard deviations and rises of the zeros. */
static void set_deviations(Tare *tare, const Judgement *j) {
    const WindowStatistics *statistics = &tare->statistics;
    const size_t n = tare->n_gauges, b = statistics->n_stretches;
    const double samples = tare->window.counts.samples, length = tare->window.counts.length;
    double places = 0.0, sum = 0.0, sum_fine = 0.0, all = 1.0; /* of all gauges, on the variance */
    size_t moving = 0, alike = 0;
    for (size_t k = 0; k < b; k++) {
        const double place = ((double)k - 0.5 * (double)(b - 1)) * length / samples;
        places += place * place;
    }
    for (size_t i = 0; i < n; i++) {
        double slope, coarse_slope;
        const double square = means_about_line(statistics, n, i, 1, &slope), coarse = means_about_line(statistics, n, i, 2, &coarse_slope);
        const double variance = statistics->scatter[i] * statistics->scatter[i];
        const double rise = slope * samples / length, rise_std = sqrt(square / (double)(b - 2) / places);
        j->rise[i] = fabs(rise) > tare->limits.moved * rise_std ? rise : 0.0;
        if (variance > 0.0) {
            j->fine[i] = square / (double)(b - 2) * length / variance;
            j->coarse[i] = coarse / (double)(b / 2 - 2) * 2.0 * length / variance;
            j->sorted[moving++] = j->fine[i];
        }
    }
    /* Gauges up to own_factor^2 times the median have k in common. */
    const double times = tare->limits.own_factor * tare->limits.own_factor;
    const double limit = moving > 0 ? times * median(j->sorted, moving) : 0.0;
    for (size_t i = 0; i < n; i++) {
        if (statistics->scatter[i] * statistics->scatter[i] > 0.0 && j->fine[i] <= limit) {
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
        const double variance = statistics->scatter[i] * statistics->scatter[i];
        const double own = variance > 0.0 && j->fine[i] > limit && j->fine[i] > all ? j->fine[i] : all;
        const double of_known = tare->limits.known_std[i] * tare->limits.known_std[i];
        j->std[i] =
            sqrt(own * statistics->scatter[i] * statistics->scatter[i] / samples + j->rise[i] * j->rise[i] / 12.0 + of_known);
    }
    tare->verdict.memory = sqrt(all);
}

/* The standard deviation of what all gauges that read have in common, of the mean over the window. */
static double common_std(const WindowStatistics *statistics, size_t n, size_t n_reading) {
    const size_t b = statistics->n_stretches;
    const double freedom = (double)(b - 2), count = (double)n_reading;
    double of_each = 0.0, sums[MAX_STRETCHES] = {0.0}, slope;
    if (n_reading < 2) {
        return 0.0;
    }
    for (size_t i = 0; i < n; i++) { /* those that do not read are 0 */
        of_each += means_about_line(statistics, n, i, 1, &slope);
        for (size_t k = 0; k < b; k++) {
            sums[k] += statistics->stretch[k * n + i];
        }
    }
    const double of_sums = about_line(b, sums, &slope);
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

static void add_fault(TareVerdict *verdict, int fault, int is_one) {
    verdict->faults += is_one ? fault : 0;
}

static void judge_drift(Tare *tare, const double *rise) {
    TareVerdict *v = &tare->verdict;
    const size_t worst = largest_of(rise, tare->n_gauges);
    v->drifting_gauge = (double)(worst + 1);
    v->drift = rise[worst];
    add_fault(v, TARE_DRIFTS, fabs(v->drift) > tare->limits.drift);
}

static void judge_scatter(Tare *tare) {
    const double *scatter = tare->statistics.scatter, *noise = tare->limits.noise_std;
    TareVerdict *v = &tare->verdict;
    size_t worst = 0;
    for (size_t i = 1; i < tare->n_gauges; i++) {
        worst = scatter[i] / noise[i] > scatter[worst] / noise[worst] ? i : worst;
    }
    v->moving_gauge = (double)(worst + 1);
    v->scatter = scatter[worst];
    add_fault(v, TARE_MOVES, v->scatter > tare->limits.loud * noise[worst]);
}

static void judge_size(Tare *tare) {
    TareVerdict *v = &tare->verdict;
    const size_t worst = largest_of(tare->statistics.mean, tare->n_gauges);
    v->largest_gauge = (double)(worst + 1);
    v->largest = tare->statistics.mean[worst];
    add_fault(v, TARE_TOO_LARGE, fabs(v->largest) > tare->limits.zero);
}

/* Make the patterns of load orthonormal over the gauges that read, by modified Gram-Schmidt; the number of them. A
   pattern that the others make up has no direction of its own. */
static size_t load_directions(const Tare *tare, size_t wanted, double *direction) {
    const size_t n = tare->n_gauges;
    size_t count = 0;
    for (size_t p = 0; p < wanted; p++) {
        double *row = direction + count * n, whole = 0.0, left = 0.0;
        for (size_t i = 0; i < n; i++) {
            row[i] = tare->statistics.reads[i] ? tare->limits.pattern[p * n + i] : 0.0;
            whole += row[i] * row[i];
        }
        for (size_t k = 0; k < count; k++) {
            const double *before = direction + k * n, part = dot(n, before, row);
            for (size_t i = 0; i < n; i++) {
                row[i] -= part * before[i];
            }
        }
        left = dot(n, row, row);
        if (left > LEAST_OWN_PART * whole) {
            for (size_t i = 0; i < n; i++) {
                row[i] /= sqrt(left);
            }
            count++;
        }
    }
    return count;
}

/* Sum of squares of the zeros along patterns of load, against what random zeros of the same rest stay below. The
   noise of the gauges is a lower bound of the rest. */
static void judge_pattern(Tare *tare, size_t n_reading, Judgement *j) {
    const size_t n = tare->n_gauges, most = n_reading / GAUGES_PER_PATTERN;
    const size_t wanted = tare->limits.n_patterns < most ? tare->limits.n_patterns : most;
    const size_t count = load_directions(tare, wanted, j->direction);
    const double *value = tare->statistics.mean; /* 0 of gauges that do not read */
    double along = 0.0;
    if (count == 0) {
        return;
    }
    for (size_t k = 0; k < count; k++) {
        const double part = dot(n, value, j->direction + k * n);
        along += part * part;
    }
    memcpy(j->sorted, tare->limits.noise_std, n * sizeof *j->sorted);
    const double noise = median(j->sorted, n), left = dot(n, value, value) - along;
    const double of_noise = noise * noise * (double)(n_reading - count);
    tare->verdict.along = sqrt(along);
    tare->verdict.along_limit = sqrt(tare->limits.load_odds[n_reading] * (left > of_noise ? left : of_noise));
    add_fault(&tare->verdict, TARE_LIKE_LOAD, tare->verdict.along > tare->verdict.along_limit);
}

/* Zeros and standard deviations of the window, and their size. */
static void set_zeros(Tare *tare, const double *std, size_t n_reading) {
    const size_t n = tare->n_gauges;
    const double largest = tare->largest_zero, common = common_std(&tare->statistics, n, n_reading);
    TareVerdict *v = &tare->verdict;
    double square = 0.0;
    for (size_t i = 0; i < n; i++) {
        const double value = tare->statistics.mean[i]; /* 0 without reading */
        const int is_known = tare->statistics.reads[i] && std[i] < largest;
        tare->judged[i] = fabs(value) <= largest ? value : 0.0;
        tare->judged[n + i] = is_known ? std[i] : largest;
        if (is_known) {
            v->gauges += 1.0;
            square += tare->judged[i] * tare->judged[i];
            v->largest_std = std[i] > v->largest_std ? std[i] : v->largest_std;
        }
    }
    tare->judged[2 * n] = common < largest ? common : largest;
    v->rms = v->gauges > 0.0 ? sqrt(square / v->gauges) : 0.0;
    add_fault(v, TARE_FEW_GAUGES, v->gauges < tare->limits.least_gauges * (double)n);
}

void tare_judge(Tare *tare) {
    const size_t n = tare->n_gauges;
    Judgement j = {tare->scratch,         tare->scratch + n,     tare->scratch + 2 * n,
                   tare->scratch + 3 * n, tare->scratch + 4 * n, tare->scratch + 5 * n};
    size_t n_reading = 0;
    set_deviations(tare, &j);
    for (size_t i = 0; i < n; i++) {
        n_reading += tare->statistics.reads[i];
        tare->statistics.mean[i] -= tare->statistics.reads[i] ? tare->limits.known_strain[i] : 0.0;
    }
    judge_drift(tare, j.rise);
    judge_scatter(tare);
    judge_size(tare);
    judge_pattern(tare, n_reading, &j);
    set_zeros(tare, j.std, n_reading);
}
