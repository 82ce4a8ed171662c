#include "freeze_watch.h"

#include <math.h>
#include <stddef.h>

static double smaller(double a, double b) {
    return a < b ? a : b;
}

/* The sums of `value` over the gauges of every group but those `left_out`; the last group is all gauges. */
static void sum_groups(const SbWatch *w, const double *value, const uint8_t *left_out, double *sum) {
    double all = 0.0;
    for (int64_t group = 0; group + 1 < w->n_groups; group++) {
        double own = 0.0;
        for (int64_t k = w->group_first[group]; k < w->group_first[group + 1]; k++) {
            own += left_out != NULL && left_out[w->order[k]] ? 0.0 : value[w->order[k]];
        }
        sum[group] = own;
        all += own;
    }
    sum[w->n_groups - 1] = all;
}

/* Add a cycle's second differences; of a gauge whose frame is missing the last difference is kept. */
static void add_cycle(SbWatch *w, const double *difference) {
    for (int64_t i = 0; i < w->n; i++) {
        const double second = difference[i] - w->difference[i];
        if (isfinite(second)) {
            w->squares[i] += smaller(second * second, w->largest[i]);
            w->counts[i] += 1.0;
        }
        if (isfinite(difference[i])) {
            w->difference[i] = difference[i];
        }
    }
}

/* Mean squares of every group as parts of the usual ones, and their numbers. */
static void mean_squares(const SbWatch *w, const uint8_t *left_out, double *variance, double *number) {
    sum_groups(w, w->squares, left_out, variance);
    sum_groups(w, w->counts, left_out, number);
    for (int64_t group = 0; group < w->n_groups; group++) {
        variance[group] /= number[group] > 1.0 ? number[group] : 1.0;
    }
}

/* The CUSUM test of the variance. Second differences of noise are correlated: half of them count. */
static void judge_scatter(SbWatch *w, const double *variance, const double *number) {
    int64_t any = 0;
    for (int64_t group = 0; group < w->n_groups; group++) {
        const double usual = smaller(w->margin * w->level[group], 1.0);
        double increment = 0.25 * number[group] * (w->log_ratio - w->slope * variance[group] / usual);
        if (usual * w->steps_squared[group] < w->smallest_scatter) {
            increment = -w->largest_evidence;
        }
        const double evidence = w->evidence[group] + increment;
        w->evidence[group] = evidence > 0.0 ? smaller(evidence, w->largest_evidence) : 0.0;
        any |= w->evidence[group] > w->scatter_limit;
    }
    w->any_too_little = w->is_known && any;
    const int all = w->evidence[w->n_groups - 1] > w->scatter_limit;
    for (int64_t i = 0; i < w->n; i++) {
        w->too_little[i] = all || w->evidence[w->frame[i]] > w->scatter_limit;
    }
}

/* Bring the usual variance of groups without much evidence up to date; 1 if one has changed by 5 % since the last. */
static int64_t learn_level(SbWatch *w, const double *variance, const double *number) {
    int64_t has_changed = 0;
    for (int64_t group = 0; group < w->n_groups; group++) {
        if (!(number[group] > 0.0) || (w->is_known && w->evidence[group] > w->held_evidence)) {
            continue;
        }
        double *level = &w->level[group], *memory = &w->memory[group];
        *level += (smaller(variance[group], w->largest_learned) - *level) / *memory;
        *memory = smaller(*memory + 1.0, w->memory_length);
        has_changed |= fabs(*level - w->learned[group]) > 0.05 * w->learned[group];
    }
    return has_changed;
}

/* Judge the second differences of a block, and learn from the differences of living gauges. */
static int64_t judge_block(SbWatch *w, const int64_t *run) {
    double *variance = w->mean, *number = w->mean + w->n_groups;
    for (int64_t i = 0; i < w->n; i++) {
        w->squares[i] *= w->weight[i];
    }
    /* Gauges that repeat their reading have been found: their lack of scatter must not count against the others. */
    mean_squares(w, w->repeating, variance, number);
    judge_scatter(w, variance, number);
    for (int64_t i = 0; i < w->n; i++) {
        w->has_moved[i] |= w->squares[i] > 0.0;
        if (!w->has_moved[i] || run[i] > w->alive) {
            w->squares[i] = w->counts[i] = 0.0;
        }
    }
    mean_squares(w, NULL, variance, number);
    return learn_level(w, variance, number);
}

int64_t sb_watch_scatter(SbWatch *watch, const double *difference, const int64_t *run) {
    SbWatch *w = watch;
    int64_t has_changed = 0;
    add_cycle(w, difference);
    if (++w->blocked == w->block) {
        has_changed = judge_block(w, run);
        w->blocked = 0;
        for (int64_t i = 0; i < w->n; i++) {
            w->squares[i] = w->counts[i] = 0.0;
        }
    }
    return has_changed;
}

static int64_t capped(int64_t run) {
    return run < SB_LONGEST_RUN ? run : SB_LONGEST_RUN;
}

/* Whether chance may not give so many late gauges; the bound is the longest run's. */
static int may_be_improbable(const SbWatch *w, const int64_t *run) {
    int64_t late = 0, longest = 0;
    for (int64_t i = 0; i < w->n; i++) {
        late += run[i] >= w->shortest_run;
        longest = run[i] > longest ? run[i] : longest;
    }
    return late > 1 && (double)late * w->least[capped(longest)] < w->limit;
}

/* The logarithm of the probability of so many repetitions of each gauge, 0 where it is not present. */
static void find_probabilities(SbWatch *w, const double *strain, const int64_t *run, const uint8_t *present) {
    for (int64_t i = 0; i < w->n; i++) {
        const double *table = fabs(strain[i]) < 0.5 * w->step[i] ? w->log_repeated_zero : w->log_repeated;
        const int counts = present[i] && run[i] >= w->shortest_run;
        w->log_probability[i] = counts ? table[w->row[i] * (SB_LONGEST_RUN + 1) + capped(run[i])] : 0.0;
    }
}

/* Shell's sort, with gaps of which each is about a third of the one before. */
static void sort(double *value, int64_t n) {
    int64_t gap = 1;
    while (gap < n / 3) {
        gap = 3 * gap + 1;
    }
    for (; gap > 0; gap /= 3) {
        for (int64_t i = gap; i < n; i++) {
            const double moved = value[i];
            int64_t k = i;
            for (; k >= gap && value[k - gap] > moved; k -= gap) {
                value[k] = value[k - gap];
            }
            value[k] = moved;
        }
    }
}

/* Add the gauges of a group that repeat their reading together; 1 if there are any. */
static int64_t find_in_group(SbWatch *w, const int64_t *gauge, int64_t n, const double *choices) {
    for (int64_t k = 0; k < n; k++) {
        w->ranked[k] = w->log_probability[gauge[k]];
    }
    sort(w->ranked, n);
    int64_t count = 0;
    for (int64_t k = 2; k <= n; k++) { /* single gauges have a limit of their own */
        if (choices[k - 1] + (double)k * w->ranked[k - 1] < w->limit) {
            count = k;
        }
    }
    for (int64_t k = 0; count && k < n; k++) {
        w->repeating[gauge[k]] |= w->log_probability[gauge[k]] <= w->ranked[count - 1];
    }
    return count > 0;
}

int64_t sb_watch_find(SbWatch *watch, const double *strain, const int64_t *run, const uint8_t *present) {
    SbWatch *w = watch;
    const int improbable = may_be_improbable(w, run);
    int64_t any = w->any_too_little;
    for (int64_t i = 0; i < w->n; i++) {
        w->repeating[i] = 0;
    }
    if (!improbable && !any) {
        return 0;
    }
    if (improbable) {
        find_probabilities(w, strain, run, present);
        for (int64_t group = 0; group < w->n_groups; group++) {
            const int64_t first = w->group_first[group], n = w->group_first[group + 1] - first;
            any |= find_in_group(w, w->order + first, n, w->choices + first);
        }
    }
    for (int64_t i = 0; i < w->n; i++) {
        w->found[i] = w->repeating[i] || (w->any_too_little && w->too_little[i] && present[i]);
    }
    return any;
}

int watch_may_be_chance(const SbWatch *w, const double *strain, const uint8_t *present, const uint8_t *only,
                        int64_t run) {
    double sum = 0.0;
    const int64_t place = capped(run);
    for (int64_t i = 0; i < w->n; i++) {
        if (present[i] && (only == NULL || only[i])) {
            const int64_t row = w->row[i] * (SB_LONGEST_RUN + 1);
            const double *zero = w->log_repeated_zero + row;
            const int is_zero = fabs(strain[i]) < 0.5 * w->step[i];
            sum += is_zero ? zero[place] : w->log_repeated[row + place];
            /* Beyond the table every repetition is as probable as in the middle of a step, where it is most. */
            sum += (double)(run - place) * (zero[SB_LONGEST_RUN] - zero[SB_LONGEST_RUN - 1]);
        }
    }
    return sum >= w->limit;
}
