/* The filter over time: samples, what they have in common, and the state that a step leaves.

   Each number that is averaged is a channel y of variance sigma^2 = nu + lambda: nu averages out (noise of gauges, a
   part of the variance of air data), lambda lasts. windows.c averages values and leaves f nu of the variance, so
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

static const size_t OF_SETTINGS[] = {REFERENCE_AREA, REFERENCE_LENGTH, MOMENT_STATION};
#define N_SETTINGS (sizeof OF_SETTINGS / sizeof *OF_SETTINGS)
#define N_SPAN (sizeof(Span) / sizeof(double))

/* What is serialised is in one piece: held, last values, variances and rates, then the spans. */
static void lay_out(void *part, Room *room) {
    Filter *filter = part;
    const size_t channels = filter->channels;
    filter->row = taken(room, filter->n_row);
    filter->kept = filter->held = taken(room, filter->n_held);
    filter->last_value = taken(room, channels);
    filter->last_variance = taken(room, channels);
    filter->last_rate = taken(room, channels);
    windows_arrays(&filter->windows, room);
    filter->value = taken(room, channels);
    filter->variance = taken(room, channels);
    filter->noise = taken(room, channels);
    filter->mean = taken(room, channels);
    filter->left = taken(room, channels);
    filter->factor = taken(room, channels);
    filter->rate = taken(room, channels);
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
