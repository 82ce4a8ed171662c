"""The definition of the checks of gauges in plain numpy, which the compiled ones are held against."""

from __future__ import annotations

from math import lgamma, log

import numpy as np

from strainfmu.can.cycle.gauges.freeze_watch import (
    _ALIVE,
    _BLOCK,
    _FIRST_MEMORY,
    _HELD,
    _LARGEST_EVIDENCE,
    _LARGEST_LEARNED,
    _LARGEST_SQUARE,
    _LOG_RATIO,
    _MARGIN,
    _MEMORY,
    _QUIET,
    _SLOPE,
    _SMALLEST_SCATTER,
    FALSE_ALARM,
    SHORTEST_RUN,
)
from strainfmu.can.cycle.gauges.noise import GaugeNoise
from strainfmu.can.cycle.gauges.plausibility import (
    _FADING,
    _PACE,
    MIN_STUCK_CYCLES,
    MIN_ZERO_CYCLES,
    RARE,
    ROUND_OFF,
)
from strainfmu.can.cycle.gauges.quantised_noise import LONGEST_RUN, noise_table
from strainfmu.can.settings import BridgeSettings
from strainfmu.estimator.numerics.quantisation import longest_repetition


class ReferenceWatch:
    """Gauges that are frozen together, by the formulas of ``freeze_watch``."""

    def __init__(self, noise: GaugeNoise) -> None:
        self.noise, self.table = noise, noise_table()
        n = len(noise.step)
        self.groups = [*(np.flatnonzero(noise.frame == f) for f in np.unique(noise.frame)), np.arange(n)]
        self.variance = self.table.variance_of(noise.ratio)
        self.weight = 1.0 / (6.0 * self.variance * noise.step**2)
        self.difference, self.has_moved = np.full(n, np.nan), np.zeros(n, dtype=bool)
        self.squares, self.counts, self.blocked = np.zeros(n), np.zeros(n), 0
        quiet = self.table.variance_of(np.minimum(noise.ratio, _QUIET)) / self.variance
        self.level = np.array([quiet[g].mean() for g in self.groups])
        self.memory, self.evidence = np.full(len(self.level), float(_FIRST_MEMORY)), np.zeros(len(self.level))
        self.too_little, self.repeating_before = np.zeros(n, dtype=bool), np.zeros(n, dtype=bool)
        self.learn()

    def update(
        self, strain: np.ndarray, difference: np.ndarray, run: np.ndarray, present: np.ndarray
    ) -> np.ndarray | None:
        second = difference - self.difference
        known = np.isfinite(second)
        self.squares += np.where(known, np.fmin(second**2, _LARGEST_SQUARE / self.weight), 0.0)
        self.counts += known
        self.difference = np.where(np.isfinite(difference), difference, self.difference)
        self.blocked += 1
        if self.blocked == _BLOCK:
            self.judge_block(run)
            self.squares, self.counts, self.blocked = np.zeros_like(self.squares), np.zeros_like(self.counts), 0
        self.repeating_before = self.repeating(strain, run, present)
        found = self.too_little & present | self.repeating_before
        return found if found.any() or self.too_little.any() else None

    def repeating(self, strain: np.ndarray, run: np.ndarray, present: np.ndarray) -> np.ndarray:
        capped, row = np.minimum(run, LONGEST_RUN), self.table.row(self.ratio)
        at_zero = np.abs(strain) < 0.5 * self.noise.step
        own = np.where(at_zero, self.table.log_repeated_zero[row, capped], self.table.log_repeated[row, capped])
        own = np.where(present & (run >= SHORTEST_RUN), own, 0.0)
        found = np.zeros(len(run), dtype=bool)
        for group in self.groups:
            ranked, n = np.sort(own[group]), len(group)
            for k in range(n, 1, -1):
                choices = lgamma(n + 1) - lgamma(k + 1) - lgamma(n - k + 1)
                if choices + k * ranked[k - 1] < log(FALSE_ALARM):
                    found[group] |= own[group] <= ranked[k - 1]
                    break
        return found

    def judge_block(self, run: np.ndarray) -> None:
        squares = self.squares * self.weight
        for group, gauges in enumerate(self.groups):
            others = gauges[~self.repeating_before[gauges]]
            count = self.counts[others].sum()
            usual = min(_MARGIN * self.level[group], 1.0)
            variance = squares[others].sum() / max(count, 1.0)
            increment = 0.25 * count * (_LOG_RATIO - _SLOPE * variance / usual)
            if usual * self.variance[gauges].mean() < _SMALLEST_SCATTER:
                increment = -_LARGEST_EVIDENCE
            self.evidence[group] = np.clip(self.evidence[group] + increment, 0.0, _LARGEST_EVIDENCE)
        if self.noise.is_known:
            found = self.evidence > -log(FALSE_ALARM)
            self.too_little = found[self.noise.frame] | found[-1]
        self.has_moved |= squares > 0.0
        alive = self.has_moved & (run <= _ALIVE)
        for group, gauges in enumerate(self.groups):
            count = (self.counts * alive)[gauges].sum()
            if count > 0.0 and not (self.noise.is_known and self.evidence[group] > _HELD):
                seen = min((squares * alive)[gauges].sum() / count, _LARGEST_LEARNED)
                self.level[group] += (seen - self.level[group]) / self.memory[group]
                self.memory[group] = min(self.memory[group] + 1.0, _MEMORY)
        if (np.abs(self.level - self.learned) > 0.05 * self.learned).any():
            self.learn()

    def learn(self) -> None:
        self.learned = self.level.copy()
        level = np.where(self.memory > _FIRST_MEMORY, self.level, self.level[-1])
        usual = np.minimum(_MARGIN * level[self.noise.frame], 1.0)
        self.ratio = np.minimum(_MARGIN * self.table.ratio_of(usual * self.variance), self.noise.ratio)


class ReferenceChecks:
    """The checks of single gauges, by the formulas of ``plausibility``; all gauges come in every cycle."""

    def __init__(self, n: int, cycle_time: float, settings: BridgeSettings, noise: GaugeNoise) -> None:
        self.settings, self.cycle_time, self.watch = settings, cycle_time, ReferenceWatch(noise)
        self.last_raw, self.seen = np.zeros(n, dtype=np.int64), np.zeros(n, dtype=bool)
        self.last_strain, self.last_good = np.full(n, np.nan), np.full(n, np.nan)
        self.good_time, self.pace = np.zeros(n), np.zeros(n)
        self.changed, self.heard, self.unheard = np.full(n, np.inf), np.full(n, np.nan), np.zeros(n)
        self.repeats, self.zeros = np.zeros(n, dtype=np.int64), np.zeros(n, dtype=np.int64)
        self.good = np.full(n, settings.heal_cycles)

    def update(
        self, strain: np.ndarray, raw: np.ndarray, present: np.ndarray, refused: np.ndarray, now: float
    ) -> np.ndarray:
        settings, difference = self.settings, strain - self.last_strain
        stuck_cycles, zero_cycles = self.too_many()
        same = present & self.seen & (raw == self.last_raw)
        self.repeats = np.where(same, self.repeats + 1, np.where(present, 0, self.repeats))
        lost = np.fmax(np.rint((now - self.heard) / self.cycle_time) - 1.0, 0.0) * self.cycle_time
        self.changed = np.where(present & ~same, now, self.changed)
        self.unheard = np.where(present & ~same, lost, self.unheard)
        self.heard, self.last_raw = np.where(present, now, self.heard), np.where(present, raw, self.last_raw)
        self.seen |= present
        frozen = self.watch.update(strain, difference, self.repeats, present)
        zero_cycles = self.too_many()[1]  # by the noise that this cycle may have taught
        zero = present & ((raw == 0) | (np.abs(strain) <= ROUND_OFF))
        self.zeros = np.where(zero, self.zeros + 1, np.where(present, 0, self.zeros))
        fell = np.abs(strain - self.last_good) > settings.zero_jump + _PACE * self.pace
        bad = refused | ~(np.abs(strain) <= settings.sensor_range) | (np.abs(difference) > settings.rate_limit)
        bad |= same & (self.repeats >= stuck_cycles) | zero & (fell | (self.zeros >= zero_cycles))
        if frozen is not None and settings.stuck_cycles != 0:
            bad |= frozen
        good = present & ~bad
        self.good = np.where(good, self.good + 1, np.where(present, 0, self.good))
        self.last_strain = np.where(present & np.isfinite(strain), strain, self.last_strain)
        cycles = np.maximum((now - self.good_time) / self.cycle_time, 1.0)
        pace = np.maximum(np.abs(strain - self.last_good) / cycles, _FADING * self.pace)
        self.pace = np.where(good & np.isfinite(pace), pace, self.pace)
        self.last_good = np.where(good, strain, self.last_good)
        self.good_time = np.where(good, now, self.good_time)
        return good & (self.good >= settings.heal_cycles)

    def frozen(self, present: np.ndarray, now: float) -> tuple[float, float]:
        if not present.any():
            return 0.0, 0.0
        since = np.maximum(now - self.changed, self.repeats * self.cycle_time)
        known = (since + np.where(self.repeats > 0, self.unheard, 0.0))[present].min()
        return known, max((since + self.unheard)[present].min() - known, 0.0)

    def too_many(self) -> tuple[np.ndarray, np.ndarray]:
        """Return (n_d,) numbers of equal readings and of zeros in a row that are too many."""
        by_noise = np.array([np.ceil(min(longest_repetition(r, RARE), 1e6)) for r in self.watch.ratio.tolist()])
        stuck, zero = np.maximum(by_noise, MIN_STUCK_CYCLES), np.maximum(by_noise, MIN_ZERO_CYCLES)
        if self.settings.stuck_cycles is not None:
            stuck[:] = self.settings.stuck_cycles or np.inf
        if self.settings.zero_cycles is not None:
            zero[:] = self.settings.zero_cycles
        return stuck, zero
