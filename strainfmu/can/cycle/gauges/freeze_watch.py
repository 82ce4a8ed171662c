"""The watch for frozen gauges: too many that repeat their reading, or readings that scatter less than noise does.

Repeated readings: of the n gauges of a frame, or of all, at least k have repeated theirs m times in a row. With
quantised noise (:mod:`~strainfmu.can.cycle.gauges.quantised_noise`) that has at most the probability
C(n, k) P(m)^k. Those k gauges are frozen where it is below FALSE_ALARM.

Scatter: a sender that repeats old strains and changes their last bit never repeats a reading. The second
differences of the readings, in which load hardly appears, then have less variance than noise gives them. A CUSUM
test of the variance, one for each frame and one for all gauges, has the log-likelihood ratio of LOW_VARIANCE
times the usual variance against the usual one as its increment (E. S. Page, Biometrika 41, 1954).

The usual variance is that of the stated noise, or what has been seen in this run where that is less.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import lgamma, log
from operator import lt

import numpy as np

from strainfmu.arrays import BoolArray, FloatArray, IntArray
from strainfmu.can.cycle.gauges.noise import GaugeNoise
from strainfmu.can.cycle.gauges.quantised_noise import LONGEST_RUN, noise_table

FALSE_ALARM = 1e-12
"""Maximum probability per frame and cycle of taking healthy gauges for frozen."""

SHORTEST_RUN = 3
"""Repetitions that count: an amplifier may sample at a third of the rate at which it sends."""

LOW_VARIANCE = 0.2
"""Variance of a frozen frame's scatter that the test is made for, as part of the usual one."""

_LOG_RATIO, _SLOPE = -log(LOW_VARIANCE), 1.0 / LOW_VARIANCE - 1.0
"""The log-likelihood ratio of a variance x, in usual ones, is half of the first less x times the second."""

_LOOKED_AT = _LOG_RATIO / _SLOPE
"""Variance, in usual ones, below which the ratio is evidence for frozen gauges."""

_BLOCK = 4
"""Cycles whose second differences are judged together."""

_LARGEST_SQUARE = 4.0
"""Maximum square of a second difference, as part of its variance: one gauge must not outweigh a frame."""

_MEMORY, _FIRST_MEMORY, _LARGEST_LEARNED = 64, 16, 1.2
"""Blocks over which the usual variance is averaged, as many at the start, and the largest of one block, as part of
the stated one."""

_ALIVE = 25
"""Repetitions in a row beyond which a gauge says nothing about the usual variance."""

_QUIET = 0.2
"""Noise in quantisation steps that is assumed at the start: less than that of most gauges."""

_SMALLEST_SCATTER = 0.3
"""Usual variance [quantisation steps^2] below which scatter is not judged.

It is that of noise of half a step; with less of it, scatter depends on where in a step the strain lies."""

_HELD, _LARGEST_EVIDENCE = 5.0, 35.0
"""Evidence above which the usual variance is not learned, and beyond which it is not counted."""

_MARGIN = 0.9
"""Factor on the usual variance, and on the standard deviation that follows from it."""


class FreezeWatch:
    """Follows the readings of the gauges of all frames over successive cycles."""

    def __init__(self, noise: GaugeNoise) -> None:
        n = len(noise.step)
        self._noise, self._table = noise, noise_table()
        self._order = np.argsort(noise.frame, kind="stable")
        self._first = np.flatnonzero(np.diff(noise.frame[self._order], prepend=-1))
        self._frames = [np.flatnonzero(noise.frame == frame) for frame in np.unique(noise.frame)]
        self._log_choices = {len(one): _log_choices(len(one)) for one in [*self._frames, np.arange(n)]}
        self._variance = self._table.variance_of(noise.ratio)
        self._weight = 1.0 / (6.0 * self._variance * noise.step**2)
        self._difference = np.full(n, np.nan)
        self._squares, self._counts = np.zeros(n), np.zeros(n)
        # Second differences of the block's whole cycles that are not yet in the sum of squares.
        self._second = np.zeros((_BLOCK, n))
        self._rows, self._held = list(self._second), 0
        self._shortest = np.full(n, SHORTEST_RUN, dtype=np.int64)
        self._longest, self._late = 0, np.empty(n, dtype=bool)
        # One row for each cycle of a block: a single one is spread over them in every call, at thrice the time.
        self._largest = np.tile(_LARGEST_SQUARE / self._weight, (_BLOCK, 1))
        self._has_moved, self._all_moved = np.zeros(n, dtype=bool), False
        # Cycles of this block, those of them with all gauges, and whether all had a difference before.
        self._blocked, self._whole, self._is_complete = 0, 0, False
        self._everywhere = np.ones(n, dtype=bool)
        self._is_ordered = bool((np.diff(self._order) == 1).all())
        groups = self._by_group(np.ones(n))
        self._block_size = [_BLOCK * size for size in groups]
        self._steps_squared = np.divide(self._by_group(self._variance), groups)
        quiet = self._table.variance_of(np.minimum(noise.ratio, _QUIET)) / self._variance
        # By frame, and of all: few numbers, so lists are faster than arrays.
        self._level: list[float] = np.divide(self._by_group(quiet), groups).tolist()
        self._evidence, self._has_evidence = np.zeros(len(self._level)), False
        self._memory = [float(_FIRST_MEMORY)] * len(self._level)
        self._scatters_too_little = np.zeros(n, dtype=bool)
        self._any_too_little = False
        self._limit = log(FALSE_ALARM)
        self._learn()

    def update(
        self, strain: FloatArray, difference: FloatArray, run: IntArray, present: BoolArray | None = None
    ) -> BoolArray | None:
        """Return (n_d,) which gauges are frozen, None if none is.

        Parameters
        ----------
        strain : (n_d,) [m/m].
        difference : (n_d,) change since the last cycle [m/m], NaN where there is none; not to be written to.
        run : (n_d,) number of repetitions of the reading, at most one more than at the last update.
        present : (n_d,) gauges of this cycle; None for all, each with a difference.
        """
        self._watch_scatter(difference, run, present is None)
        np.greater_equal(run, self._shortest, self._late)
        repeating, late = None, self._late.tobytes().count(1)
        if late > 1 and self._may_be_improbable(late, run):
            here = self._everywhere if present is None else present
            repeating = self._repeating(self._log_probability(strain, run, here))
        if not self._any_too_little:
            return repeating
        found = self._scatters_too_little if present is None else self._scatters_too_little & present
        return found if repeating is None else found | repeating

    def _may_be_improbable(self, late: int, run: IntArray) -> bool:
        """Return whether chance may not give so many ``late`` gauges; the bound is that of the longest run."""
        if late * self._least[min(self._longest, LONGEST_RUN)] >= self._limit:
            return False
        self._longest = int(run.max())
        return late * self._least[min(self._longest, LONGEST_RUN)] < self._limit

    @property
    def noise_ratio(self) -> FloatArray:
        """(n_d,) noise in quantisation steps that is counted on: stated, or less where less has been seen."""
        return self._ratio

    def may_be_chance(self, gauges: IntArray, run: int) -> bool:
        """Return whether healthy ``gauges`` may all repeat their readings ``run`` times in a row."""
        row = self._table.row(self._ratio[gauges])
        return float(self._table.log_repeated[row, min(run, LONGEST_RUN)].sum()) >= self._limit

    # --- repeated readings --------------------------------------------------------------------------------------

    def _log_probability(self, strain: FloatArray, run: IntArray, present: BoolArray) -> FloatArray:
        """Return (n_d,) the logarithm of the probability of so many repetitions, 0 where not present."""
        capped = np.minimum(run, LONGEST_RUN)
        at_zero = np.abs(strain) < 0.5 * self._noise.step
        table = np.where(
            at_zero, self._log_repeated_zero[self._gauge, capped], self._log_repeated[self._gauge, capped]
        )
        return np.where(present, table, 0.0)

    def _repeating(self, log_probability: FloatArray) -> BoolArray | None:
        """Return which gauges repeat their reading together, None if chance may have it."""
        found = np.zeros(len(log_probability), dtype=bool)
        for group in [np.arange(len(found)), *self._frames]:
            own = log_probability[group]
            ranked = np.sort(own)
            number = np.arange(1, len(own) + 1)
            improbable = self._log_choices[len(own)] + number * ranked < self._limit
            improbable[:1] = False  # single gauges have a limit of their own
            if improbable.any():
                found[group] |= own <= ranked[np.flatnonzero(improbable)[-1]]
        return found if found.any() else None

    # --- scatter ------------------------------------------------------------------------------------------------

    def _watch_scatter(self, difference: FloatArray, run: IntArray, is_whole: bool) -> None:
        """Take in the readings' second differences; judge them at the end of a block."""
        # No run is longer; it is taken exactly only where this bound does not suffice.
        self._longest += 1
        if is_whole and self._is_complete:
            np.subtract(difference, self._difference, self._rows[self._held])
            self._difference = difference
            self._held += 1
            self._whole += 1
        else:
            self._add_held()
            second = difference - self._difference
            known = np.isfinite(second)
            self._squares += np.where(known, np.fmin(second * second, self._largest[0]), 0.0)
            self._counts += known
            # Of a gauge whose frame is missing the last one is kept.
            self._difference = np.where(np.isfinite(difference), difference, self._difference)
            self._is_complete = bool(np.isfinite(self._difference).all())
        self._blocked += 1
        if self._blocked == _BLOCK:
            self._add_held()
            self._judge_block(run)
            self._squares.fill(0.0)
            if self._whole < _BLOCK:
                self._counts.fill(0.0)
            self._blocked = self._whole = 0

    def _add_held(self) -> None:
        """Add the squares of the second differences that are held."""
        if not self._held:
            return
        second = self._second[: self._held]
        np.multiply(second, second, out=second)
        np.minimum(second, self._largest[: self._held], out=second)
        self._squares += np.add.reduce(second)
        self._held = 0

    def _judge_block(self, run: IntArray) -> None:
        """Judge the second differences of a block, and learn from those of living gauges."""
        squares = self._squares * self._weight
        counts = None if self._whole == _BLOCK else self._counts + self._whole
        variance, count = self._variances(squares, counts)
        if self._has_evidence or any(map(lt, variance, self._low)):
            self._judge_scatter(np.array(variance), np.array(count))
        if not self._all_moved:
            self._has_moved |= squares > 0.0
            self._all_moved = bool(self._has_moved.all())
        if not (self._all_moved and (self._longest <= _ALIVE or run.max() <= _ALIVE)):
            is_alive = self._has_moved & (run <= _ALIVE)
            counts = self._whole + self._counts
            variance, count = self._variances(squares * is_alive, counts * is_alive)
        self._learn_level(variance, count)

    def _variances(self, squares: FloatArray, counts: FloatArray | None) -> tuple[list[float], list[float]]:
        """Return, of every group, the mean squares as parts of the stated ones, and their numbers."""
        sums = self._by_group(squares)
        count = self._block_size if counts is None else self._by_group(counts)
        return [
            total / (number if number > 1.0 else 1.0) for total, number in zip(sums, count, strict=True)
        ], count

    def _judge_scatter(self, variance: FloatArray, count: FloatArray) -> None:
        """Update the evidence of every group."""
        # Second differences of noise are correlated: half of them count.
        usual = np.minimum(_MARGIN * np.array(self._level), 1.0)
        increment = 0.25 * count * (_LOG_RATIO - _SLOPE * variance / usual)
        increment[usual * self._steps_squared < _SMALLEST_SCATTER] = -_LARGEST_EVIDENCE
        self._evidence = np.clip(self._evidence + increment, 0.0, _LARGEST_EVIDENCE)
        self._has_evidence = bool(self._evidence.any())
        found = self._evidence > -self._limit
        self._any_too_little = self._noise.is_known and bool(found.any())
        self._scatters_too_little = found[self._noise.frame] | found[-1]

    def _learn_level(self, variance: Sequence[float], count: Sequence[float]) -> None:
        """Bring the usual variance of groups without much evidence up to date."""
        level, memory = self._level, self._memory
        evidence = self._evidence.tolist() if self._noise.is_known and self._has_evidence else None
        has_changed = False
        for group, seen in enumerate(variance):
            if not count[group] > 0.0 or (evidence is not None and evidence[group] > _HELD):
                continue
            level[group] += (min(seen, _LARGEST_LEARNED) - level[group]) / memory[group]
            memory[group] = min(memory[group] + 1.0, _MEMORY)
            has_changed = has_changed or abs(level[group] - self._learned[group]) > 0.05 * self._learned[group]
        if has_changed:
            self._learn()
        else:
            self._use_level()

    def _use_level(self) -> None:
        """Derive from the usual variance below what a block is looked at closely."""
        self._low = [min(_MARGIN * level, 1.0) * _LOOKED_AT for level in self._level]

    def _learn(self) -> None:
        """Derive from the usual variance which noise is counted on, and the probabilities of repetitions."""
        self._use_level()
        self._learned = self._level.copy()
        # A frame that is dead from the start teaches nothing: the others stand for it.
        level = np.where(np.array(self._memory) > _FIRST_MEMORY, self._level, self._level[-1])
        usual = np.minimum(_MARGIN * level[self._noise.frame], 1.0)
        self._ratio = np.minimum(_MARGIN * self._table.ratio_of(usual * self._variance), self._noise.ratio)
        row = self._table.row(self._ratio)
        self._log_repeated = self._table.log_repeated[row]
        self._log_repeated_zero = self._table.log_repeated_zero[row]
        self._log_repeated[:, :SHORTEST_RUN] = self._log_repeated_zero[:, :SHORTEST_RUN] = 0.0
        self._least = np.minimum(self._log_repeated, self._log_repeated_zero).min(axis=0).tolist()
        self._gauge = np.arange(len(self._ratio))

    def _by_group(self, values: FloatArray) -> list[float]:
        """Return n_f + 1 numbers: the sums of (n_d,) ``values`` over each of n_f frames, and over all."""
        ordered = values if self._is_ordered else values[self._order]
        by_group: list[float] = np.add.reduceat(ordered, self._first).tolist()
        by_group.append(sum(by_group))
        return by_group


def _log_choices(n: int) -> FloatArray:
    """Return (n,) the logarithms of the number of choices of k = 1 .. n from n."""
    return np.array([lgamma(n + 1) - lgamma(k + 1) - lgamma(n - k + 1) for k in range(1, n + 1)])
