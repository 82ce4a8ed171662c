/* The filter over time: samples, what they have in common, and the state that a step leaves.

   Each number that is averaged is a channel y of variance sigma^2 = nu + lambda: nu averages out (noise of gauges, a
   part of the variance of air data), lambda lasts. Windows (below) average values and leave f nu of the variance, so
   that

       filtered value = fit of the window,      filtered variance = f nu + lambda = left + (variance - noise),
       factor = sqrt(filtered variance / variance)     on standard deviations, for covariances of the sample.

   Samples may be averaged only while they mean the same: `held` are zero offsets (where one has a standard
   deviation), references and moment point of the samples before; where the sample at hand has others, the windows
   begin again. A step computes the filtered outputs from the samples before it and changes nothing; the sample joins
   the windows when the next step comes (filter_take_next), so that inputs may be set and outputs read any number of
   times in between. Time between samples is counted by a clock that no step moves by more than the longest window: a
   pause of hours costs no digits.

   docs/explanation/filter.md, "Model" and "What does not fit"; strainfmu/estimator/reference/windows.py. */

#include "filter.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define LARGEST_VALUE 1e60      /* of a channel, */
#define LARGEST_VARIANCE 1e120  /* and of its variance: none of what follows from them overflows, */
#define LARGEST 1e140           /* or is larger */
#define SMALLEST_NOISE 1e-6     /* of the variance of a channel: less is as exact as its rounding */

/* Means and straight lines over the last samples: the longest windows that agree with all shorter ones.

   A window holds the sample at hand, at the time T, and n - 1 samples before it. Of each channel (values y_i at
   times t_i, variances nu_i of their noise) it keeps n, the means t_m, y_m and nu_m, and

       spread = sum of (t_i - t_m)^2,      product = sum of (t_i - t_m)(y_i - y_m).

   Two fits follow, and the fraction f of nu_m that noise leaves in them at T:

       mean   y_m,                                   f = 1 / n
       line   y_m + (T - t_m) product / spread,      f = 1 / n + (T - t_m)^2 / spread

   The interval of a fit is its value +- WIDTH sqrt(f nu_m). Windows agree while the intervals of all windows up to
   them have a point in common, in every channel: low and high are the ends of what is in common. The window in use
   has at most the PART of the samples of the longest that agrees, as that one may be off by its own interval. The
   fit of smaller f counts. A channel whose own noise is smaller than f nu_m keeps the sample: samples before may
   have had more noise.

   Samples lie in spans of 1, 2, 4, .. samples, SAME_COUNT of each at most, so that any time takes MOST_SPANS spans.
   Two sets of samples, of n_1 and n_2 with the differences dt and dy of their means, are joined by (Chan, Golub and
   LeVeque, The American Statistician 37, 1983)

       n = n_1 + n_2,   t_m += n_2 / n dt,   y_m += n_2 / n dy,
       spread += spread_2 + n_1 n_2 / n dt^2,   product += product_2 + n_1 n_2 / n dt dy,

   which cancels no digits however far the samples are from 0. docs/explanation/filter.md, "Model", where nu is the
   variance that averages out; strainfmu/estimator/reference/windows.py does the same with a list of samples. Source
   of the rule: Goldenshluger and Nemirovski, Mathematical Methods of Statistics 6 (1997). */

#define SAME_COUNT 2          /* spans of one number of samples */
#define WIDTH 2.0             /* half of an interval, in standard deviations of its noise */
#define PART 0.5              /* of the longest window that agrees: one just as long may be off by its own interval */
#define SMALLEST_SPREAD 1e-18 /* [s2] below which samples have no line */

enum { MEAN, LINE, N_FITS };

/* Hand out the arrays: first the three that are kept; channels is set. */
static void windows_arrays(Windows *windows, Room *room) {
    const size_t channels = windows->channels;
    TAKE(room, MOST_SPANS * channels, &windows->value, &windows->product, &windows->noise);
    TAKE(room, channels, &windows->sums.value, &windows->sums.product, &windows->sums.noise);
    for (int fit = 0; fit < N_FITS; fit++) {
        TAKE(room, channels, &windows->low[fit], &windows->high[fit]);
    }
}

/* Span k with its arrays. */
static Sums span_sums(const Windows *windows, size_t k) {
    const size_t first = k * windows->channels;
    return (Sums){windows->span[k], windows->value + first, windows->product + first, windows->noise + first};
}

/* Add the samples of `other` to `sums`, by the update above. */
static void join(size_t channels, Sums *sums, const Sums *other) {
    Span *span = &sums->span;
    const double count = span->count + other->span.count, part = other->span.count / count;
    const double apart = other->span.time - span->time, weight = span->count * part;
    for (size_t i = 0; i < channels; i++) {
        const double change = other->value[i] - sums->value[i];
        sums->product[i] += other->product[i] + weight * apart * change;
        sums->noise[i] += part * (other->noise[i] - sums->noise[i]);
        sums->value[i] += part * change;
    }
    span->spread += other->span.spread + weight * apart * apart;
    span->time += part * apart;
    span->count = count;
}

/* The window of the sample and the youngest `spans` spans, joined from the sample backwards: the same order, and so
   the same bits, as when it was chosen. */
static void set_window(Windows *windows, double time, size_t spans, const double *value, const double *noise) {
    Sums *sums = &windows->sums;
    const size_t size = windows->channels * sizeof *value;
    sums->span = (Span){1.0, time, 0.0};
    memcpy(sums->value, value, size);
    memset(sums->product, 0, size);
    memcpy(sums->noise, noise, size);
    for (size_t k = 0; k < spans; k++) {
        const Sums span = span_sums(windows, windows->n_spans - 1 - k);
        join(windows->channels, sums, &span);
    }
}

/* Two samples, or samples of one time, have no line that noise leaves something of. */
static int has_line(const Span *span) {
    return span->count > 2.0 && span->spread > SMALLEST_SPREAD;
}

/* f of a fit to the window at a time. */
static double left_of(const Span *span, int fit, double time) {
    const double apart = time - span->time;
    return 1.0 / span->count + (fit == LINE ? apart * apart / span->spread : 0.0);
}

/* What a fit to the window adds to its mean for each unit of a product. */
static double reach_of(const Span *span, int fit, double time) {
    return fit == LINE ? (time - span->time) / span->spread : 0.0;
}

/* Narrow what is common to all intervals of a fit by this window's; whether something is left in every channel. */
static int agrees(Windows *windows, int fit, double time) {
    const Sums *sums = &windows->sums;
    const double left = left_of(&sums->span, fit, time), reach = reach_of(&sums->span, fit, time);
    double *low = windows->low[fit], *high = windows->high[fit];
    int common = 1;
    for (size_t i = 0; i < windows->channels; i++) {
        const double value = sums->value[i] + reach * sums->product[i], half = WIDTH * sqrt(left * sums->noise[i]);
        low[i] = value - half > low[i] ? value - half : low[i];
        high[i] = value + half < high[i] ? value + half : high[i];
        common &= low[i] <= high[i];
    }
    return common;
}

/* The interval of the sample alone is the first one. */
static void begin_intervals(Windows *windows, const double *value, const double *noise) {
    for (size_t i = 0; i < windows->channels; i++) {
        const double half = WIDTH * sqrt(noise[i]);
        for (int fit = 0; fit < N_FITS; fit++) {
            windows->low[fit][i] = value[i] - half;
            windows->high[fit][i] = value[i] + half;
        }
    }
}

/* For each fit, the number of spans in the window that is used, and its f. Windows grow by a span at a time until
   neither fit agrees or a span is older than the longest time. */
static void choose(Windows *windows, double time, double longest, const double *value, const double *noise,
                   size_t chosen[N_FITS], double left[N_FITS]) {
    double count[MOST_SPANS + 1] = {1.0}, of_window[N_FITS][MOST_SPANS + 1] = {{1.0}, {1.0}}, agreed[N_FITS] = {1.0, 1.0};
    int goes_on[N_FITS] = {1, 1};
    size_t windows_seen = 1;
    begin_intervals(windows, value, noise);
    set_window(windows, time, 0, value, noise);
    for (size_t k = 0; k < windows->n_spans && (goes_on[MEAN] || goes_on[LINE]); k++, windows_seen++) {
        const Sums span = span_sums(windows, windows->n_spans - 1 - k);
        if (time - span.span.time > longest) {
            break;
        }
        join(windows->channels, &windows->sums, &span);
        count[k + 1] = windows->sums.span.count;
        for (int fit = 0; fit < N_FITS; fit++) {
            const int is_fit = fit == MEAN || has_line(&windows->sums.span);
            /* A window that has no line yet neither agrees nor disagrees: the line goes on. */
            goes_on[fit] = goes_on[fit] && (!is_fit || agrees(windows, fit, time));
            of_window[fit][k + 1] = is_fit ? left_of(&windows->sums.span, fit, time) : 1.0;
            agreed[fit] = goes_on[fit] ? count[k + 1] : agreed[fit];
        }
    }
    for (int fit = 0; fit < N_FITS; fit++) {
        chosen[fit] = 0;
        /* The largest window of at most PART of the samples that agree. */
        for (size_t k = 1; k < windows_seen && count[k] <= PART * agreed[fit]; k++) {
            chosen[fit] = k;
        }
        left[fit] = of_window[fit][chosen[fit]];
    }
}

/* Slopes of the line through the window, 0 where it has no length in time. */
static void set_rates(const Windows *windows, double *rate) {
    const Sums *sums = &windows->sums;
    const int is_known = sums->span.spread > SMALLEST_SPREAD;
    for (size_t i = 0; i < windows->channels; i++) {
        rate[i] = is_known ? sums->product[i] / sums->span.spread : 0.0;
    }
}

/* Where a sample of values and variances of their noise (channels) at a time [s] stands, by windows of at most `longest`
   [s]: its mean, the variance of the noise in it, and the rates [1/s]. The part of the noise's variance that is left; 1, and
   values and noise are the sample's, where nothing longer agrees. */
static double windows_look(Windows *windows, double time, double longest, const double *value, const double *noise, double *mean,
                    double *left, double *rate) {
    const size_t size = windows->channels * sizeof *value, one = windows->n_spans > 0;
    size_t chosen[N_FITS];
    double of_fit[N_FITS];
    choose(windows, time, longest, value, noise, chosen, of_fit);
    const int fit = of_fit[LINE] < of_fit[MEAN] ? LINE : MEAN;
    /* Rates come from the window of the line, at least from the sample and the youngest span, by mean or by line: a
       step without strain goes on with them (policies/filtered_outputs.c). */
    set_window(windows, time, chosen[LINE] > one ? chosen[LINE] : one, value, noise);
    set_rates(windows, rate);
    memcpy(mean, value, size);
    memcpy(left, noise, size);
    if (chosen[fit] == 0) {
        return 1.0;
    }
    set_window(windows, time, chosen[fit], value, noise);
    const double reach = reach_of(&windows->sums.span, fit, time);
    for (size_t i = 0; i < windows->channels; i++) {
        const double of_window = of_fit[fit] * windows->sums.noise[i];
        if (of_window < noise[i]) { /* samples before may have had more */
            mean[i] = windows->sums.value[i] + reach * windows->sums.product[i];
            left[i] = of_window;
        }
    }
    return of_fit[fit];
}

/* Take a span out, of which nothing is left. */
static void remove_span(Windows *windows, size_t k) {
    const size_t channels = windows->channels, after = windows->n_spans - 1 - k;
    double *const arrays[] = {windows->value, windows->product, windows->noise};
    memmove(windows->span + k, windows->span + k + 1, after * sizeof *windows->span);
    for (size_t a = 0; a < 3; a++) {
        memmove(arrays[a] + k * channels, arrays[a] + (k + 1) * channels, after * channels * sizeof **arrays);
    }
    windows->n_spans--;
}

/* The first of the spans of one number of samples that end before `end`. */
static size_t first_alike(const Windows *windows, size_t end) {
    size_t first = end - 1;
    while (first > 0 && windows->span[first - 1].count == windows->span[end - 1].count) {
        first--;
    }
    return first;
}

static void windows_take(Windows *windows, double time, const double *value, const double *noise) {
    const size_t size = windows->channels * sizeof *value;
    /* More than 2^20 samples: the oldest span leaves. */
    if (windows->n_spans == MOST_SPANS) {
        remove_span(windows, 0);
    }
    const Sums youngest = span_sums(windows, windows->n_spans);
    windows->span[windows->n_spans++] = (Span){1.0, time, 0.0};
    memcpy(youngest.value, value, size);
    memset(youngest.product, 0, size);
    memcpy(youngest.noise, noise, size);
    /* Where SAME_COUNT + 1 spans have one number of samples, the two oldest of them become one of twice as many,
       which may ask for the same one level up. */
    for (size_t end = windows->n_spans, first; end - (first = first_alike(windows, end)) > SAME_COUNT; end = first + 1) {
        Sums joined = span_sums(windows, first);
        const Sums next = span_sums(windows, first + 1);
        join(windows->channels, &joined, &next);
        windows->span[first] = joined.span;
        remove_span(windows, first + 1);
    }
}

static const size_t OF_SETTINGS[] = {REFERENCE_AREA, REFERENCE_LENGTH, MOMENT_STATION};
#define N_SETTINGS (sizeof OF_SETTINGS / sizeof *OF_SETTINGS)
#define N_SPAN (sizeof(Span) / sizeof(double))

/* What is serialised is in one piece: held, last values, variances and rates, then the spans. */
static void lay_out(void *part, Room *room) {
    Filter *filter = part;
    const size_t channels = filter->channels;
    filter->row = taken(room, filter->n_row);
    filter->kept = filter->held = taken(room, filter->n_held);
    TAKE(room, channels, &filter->last_value, &filter->last_variance, &filter->last_rate);
    windows_arrays(&filter->windows, room);
    TAKE(room, channels, &filter->value, &filter->variance, &filter->noise, &filter->mean, &filter->left,
         &filter->factor, &filter->rate);
    filter->latest = taken(room, filter->n_held);
}

int filter_create(MapFile *file, const Inputs *inputs, size_t channels, size_t scratch, Filter *filter) {
    if (!map_has(file, "filter")) {
        return file->good;
    }
    MAP_READ(file, "filter", FILTER, FilterMap, &filter->map);
    if (!map_require(file, filter->map.largest_time > filter->map.smallest_time, "filter.largest_time",
                     "a number above the smallest time")) {
        return 0;
    }
    filter->channels = filter->windows.channels = channels;
    filter->n_zeros = number_of_zeros(inputs->sensors->n_strains);
    filter->n_held = filter->n_zeros + N_SETTINGS;
    filter->n_kept = filter->n_held + 3 * channels + 3 * MOST_SPANS * channels;
    filter->n_row = scratch;
    filter->present = map_hand_out(file, lay_out, filter);
    return filter->present;
}

void filter_reset(Filter *filter) {
    memset(&filter->track, 0, sizeof filter->track);
    filter->windows.n_spans = 0;
    filter->is_sample = filter->is_filtered = filter->coasts = 0;
    filter->part_left = 1.0;
}

/* The clock at the sample that follows. */
static double clock_now(const Filter *filter) {
    const double apart = filter->track.now - filter->track.time, longest = filter->map.largest_time;
    return filter->track.clock + (apart > 0.0 ? (apart < longest ? apart : longest) : 0.0);
}

/* Note zero offsets and settings of the sample; whether the samples before have the same. Zero offsets count where
   one has a standard deviation: exact ones are subtracted alike from all samples. */
static int holds(Filter *filter, const Inputs *inputs) {
    int uncertain = 0;
    for (size_t k = filter->n_zeros / 2; k < filter->n_zeros; k++) {
        uncertain |= inputs->zeros[k] > 0.0;
    }
    for (size_t k = 0; k < filter->n_zeros; k++) {
        filter->latest[k] = uncertain ? inputs->zeros[k] : 0.0;
    }
    for (size_t k = 0; k < N_SETTINGS; k++) {
        filter->latest[filter->n_zeros + k] = scalar_input(inputs, OF_SETTINGS[k]);
    }
    return filter->may_move || memcmp(filter->latest, filter->held, filter->n_held * sizeof *filter->latest) == 0;
}

/* Clip the noise to at most the variance, and to no less than its rounding; whether all are numbers to calculate
   with. */
static int set_noise(Filter *filter) {
    int good = 1;
    for (size_t i = 0; i < filter->channels; i++) {
        const double variance = filter->variance[i], least = SMALLEST_NOISE * variance;
        good = good && isfinite(filter->value[i]) && fabs(filter->value[i]) < LARGEST_VALUE && isfinite(variance)
            && isfinite(filter->noise[i]) && variance >= 0.0 && variance < LARGEST_VARIANCE && filter->noise[i] >= 0.0;
        if (good) {
            filter->noise[i] = filter->noise[i] > least ? filter->noise[i] : least;
            filter->noise[i] = filter->noise[i] < variance ? filter->noise[i] : variance;
        }
    }
    return good;
}

int filter_sample(Filter *filter, const Inputs *inputs, double time_constant) {
    Windows *windows = &filter->windows;
    filter->is_sample = filter->is_filtered = set_noise(filter);
    filter->coasts = 0;
    filter->part_left = 1.0;
    if (!filter->is_sample) {
        return 0;
    }
    /* The windows begin again. They come back below: if the next inputs are the old ones, nothing has happened. */
    if (!holds(filter, inputs)) {
        windows->n_spans = 0;
    }
    filter->part_left = windows_look(windows, clock_now(filter), time_constant, filter->value, filter->noise,
                                     filter->mean, filter->left, filter->rate);
    windows->n_spans = (size_t)filter->track.n_spans;
    for (size_t i = 0; i < filter->channels; i++) {
        const double alone = filter->variance[i];
        /* f nu + lambda. */
        filter->left[i] += alone - filter->noise[i];
        filter->factor[i] = alone > 0.0 ? sqrt(filter->left[i] / alone) : 1.0;
    }
    return 1;
}

void filter_without(Filter *filter) {
    filter->is_sample = filter->is_filtered = filter->coasts = 0;
    filter->part_left = 1.0;
}

double filter_no_sample(Filter *filter, const Inputs *inputs) {
    filter_without(filter);
    return filter->track.has_last != 0.0 && holds(filter, inputs) ? clock_now(filter) - filter->track.clock : -1.0;
}

void filter_take_next(Filter *filter, double time) {
    FilterTrack *track = &filter->track;
    if (filter->is_sample) {
        const size_t size = filter->channels * sizeof *filter->value;
        const double clock = clock_now(filter);
        /* Now the sample counts, and what it does not fit is gone. */
        if (memcmp(filter->latest, filter->held, filter->n_held * sizeof *filter->latest) != 0) {
            filter->windows.n_spans = 0;
        }
        memcpy(filter->held, filter->latest, filter->n_held * sizeof *filter->held);
        windows_take(&filter->windows, clock, filter->value, filter->noise);
        memcpy(filter->last_value, filter->mean, size);
        memcpy(filter->last_variance, filter->left, size);
        memcpy(filter->last_rate, filter->rate, size);
        *track = (FilterTrack){.n_spans = (double)filter->windows.n_spans, .clock = clock, .time = track->now, .has_last = 1.0};
        filter->is_sample = 0;
    }
    track->stepped = 0.0;
    track->now = time;
}

size_t filter_state_size(const Filter *filter) {
    return filter->present ? sizeof filter->track + sizeof filter->windows.span + filter->n_kept * sizeof *filter->kept : 0;
}

void filter_write_state(const Filter *filter, unsigned char *bytes) {
    const size_t channels = filter->channels, n_spans = filter->windows.n_spans;
    if (!filter->present) {
        return;
    }
    memset(bytes, 0, filter_state_size(filter)); /* what is no longer used is not part of the state */
    memcpy(bytes, &filter->track, sizeof filter->track);
    bytes += sizeof filter->track;
    memcpy(bytes, filter->windows.span, n_spans * sizeof *filter->windows.span);
    bytes += sizeof filter->windows.span;
    if (filter->track.has_last != 0.0) {
        memcpy(bytes, filter->kept, (filter->n_held + 3 * channels) * sizeof *filter->kept);
    }
    bytes += (filter->n_held + 3 * channels) * sizeof *filter->kept;
    const double *const arrays[] = {filter->windows.value, filter->windows.product, filter->windows.noise};
    for (size_t a = 0; a < 3; a++, bytes += MOST_SPANS * channels * sizeof **arrays) {
        memcpy(bytes, arrays[a], n_spans * channels * sizeof **arrays);
    }
}

/* Whether spans are of whole numbers of samples, with sums that do not overflow. */
static int spans_fit(const Span *span, size_t count) {
    int good = 1;
    for (size_t k = 0; k < count; k++) {
        good = good && span[k].count >= 1.0 && span[k].count <= 0x1p30 && span[k].spread >= 0.0 && span[k].spread < LARGEST
            && fabs(span[k].time) < LARGEST;
    }
    return good;
}

/* A serialised state may come from anywhere: every number is checked before it is used. */
int filter_state_fits(const Filter *filter, const unsigned char *bytes) {
    FilterTrack track;
    Span span[MOST_SPANS];
    if (!filter->present) {
        return 1;
    }
    const size_t n = sizeof track / sizeof(double) + MOST_SPANS * N_SPAN + filter->n_kept;
    for (size_t k = 0; k < n; k++) {
        if (!(fabs(double_at(bytes, k)) <= LARGEST)) {
            return 0;
        }
    }
    memcpy(&track, bytes, sizeof track);
    memcpy(span, bytes + sizeof track, sizeof span);
    if (!(is_flag(track.stepped) && is_flag(track.has_last) && track.n_spans >= 0.0 && track.n_spans <= (double)MOST_SPANS && track.n_spans == (double)(size_t)track.n_spans)
        || !spans_fit(span, (size_t)track.n_spans)) {
        return 0;
    }
    const unsigned char *noise = bytes + sizeof track + sizeof span
                               + (filter->n_kept - MOST_SPANS * filter->channels) * sizeof(double);
    const unsigned char *variance = bytes + sizeof track + sizeof span + (filter->n_held + filter->channels) * sizeof(double);
    for (size_t k = 0; k < MOST_SPANS * filter->channels; k++) {
        if (!(double_at(noise, k) >= 0.0 && (k >= filter->channels || double_at(variance, k) >= 0.0))) {
            return 0;
        }
    }
    return 1;
}

void filter_read_state(Filter *filter, const unsigned char *bytes) {
    if (filter->present) {
        memcpy(&filter->track, bytes, sizeof filter->track);
        memcpy(filter->windows.span, bytes + sizeof filter->track, sizeof filter->windows.span);
        memcpy(filter->kept, bytes + sizeof filter->track + sizeof filter->windows.span, filter->n_kept * sizeof *filter->kept);
        filter->windows.n_spans = (size_t)filter->track.n_spans;
        filter->is_sample = filter->is_filtered = filter->coasts = 0;
    }
}
