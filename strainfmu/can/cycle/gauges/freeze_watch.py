"""The watch for frozen gauges: too many that repeat their reading, or readings that scatter less than noise does.

Repeated readings: of the n gauges of a frame, or of all, at least k have repeated theirs m times in a row. With
quantised noise (:mod:`~strainfmu.can.cycle.gauges.quantised_noise`) that has at most the probability
C(n, k) P(m)^k. Those k gauges are frozen where it is below FALSE_ALARM.

Scatter: a sender that repeats old strains and changes their last bit never repeats a reading. The second
differences of the readings, in which load hardly appears, then have less variance than noise gives them. A CUSUM
test of the variance, one for each frame and one for all gauges, has the log-likelihood ratio of LOW_VARIANCE
times the usual variance against the usual one as its increment (E. S. Page, Biometrika 41, 1954). Gauges that were
found by their repeated readings do not count in it: healthy ones next to them stay in use.

The usual variance is the variance of the stated noise, or what has been seen in this run where that is less.
"""

from __future__ import annotations

from math import lgamma, log

import numpy as np

from strainfmu.arrays import BoolArray, FloatArray, IntArray
from strainfmu.can.cycle.gauges.noise import GaugeNoise
from strainfmu.can.cycle.gauges.quantised_noise import LONGEST_RUN, noise_table
from strainfmu.can.wire.compiled import ARRAY, INTEGER, NUMBER, Record, function, pointer

FALSE_ALARM = 1e-12
"""Maximum probability per frame and cycle of taking healthy gauges for frozen."""

SHORTEST_RUN = 3
"""Repetitions that count: an amplifier may sample at one third of the rate at which it sends."""

LOW_VARIANCE = 0.2
"""Variance of a frozen frame's scatter that the test is made for, as part of the usual one."""

_LOG_RATIO, _SLOPE = -log(LOW_VARIANCE), 1.0 / LOW_VARIANCE - 1.0
"""The log-likelihood ratio of a variance x, in usual ones, is half of the first less x times the second."""

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
"""Noise in quantisation steps that is assumed at the start: less than the noise of most gauges."""

_SMALLEST_SCATTER = 0.3
"""Usual variance [quantisation steps^2] below which scatter is not judged.

It is the scatter of noise of half a step; with less of it, scatter depends on where in a step the strain lies."""

_HELD, _LARGEST_EVIDENCE = 5.0, 35.0
"""Evidence above which the usual variance is not learned, and beyond which it is not counted."""

_MARGIN = 0.9
"""Factor on the usual variance, and on the standard deviation that follows from it."""


class _Watch(Record):
    position = 2
    _fields_ = (
        *((name, INTEGER) for name in ("n", "n_groups", "shortest_run", "block", "alive", "is_known")),
        *((name, NUMBER) for name in ("limit", "scatter_limit", "log_ratio", "slope", "margin")),
        *((name, NUMBER) for name in ("smallest_scatter", "largest_learned", "memory_length")),
        *((name, NUMBER) for name in ("held_evidence", "largest_evidence")),
        *((name, ARRAY) for name in ("order", "group_first", "frame", "choices", "step", "weight", "largest")),
        *((name, ARRAY) for name in ("steps_squared", "log_repeated", "log_repeated_zero", "row", "least")),
        *(
            (name, ARRAY)
            for name in ("difference", "squares", "counts", "has_moved", "too_little", "found", "repeating")
        ),
        *((name, ARRAY) for name in ("level", "learned", "memory", "evidence")),
        *((name, ARRAY) for name in ("log_probability", "ranked", "mean")),
        ("blocked", INTEGER),
        ("any_too_little", INTEGER),
    )


class FreezeWatch:
    """Follows the readings of the gauges of all frames over successive cycles, in compiled code.

    Attributes
    ----------
    record : its numbers and arrays, for compiled code.
    found : (n_d,) the gauges of the last cycle that are frozen together, where there are any.
    """

    limit = log(FALSE_ALARM)
    """Logarithm of the largest probability with which chance gives what is taken for frozen."""

    scatter_limit = -limit
    """Evidence from scatter beyond which gauges are taken for frozen."""

    def __init__(self, noise: GaugeNoise) -> None:
        n = len(noise.step)
        self._noise, self._table = noise, noise_table()
        self._frame = np.unique(noise.frame, return_inverse=True)[1].astype(np.int64)
        # By frame, and of all.
        self._groups = [*(np.flatnonzero(self._frame == k) for k in range(self._frame.max() + 1)), np.arange(n)]
        n_groups = len(self._groups)
        self._variance = self._table.variance_of(noise.ratio)
        weight = 1.0 / (6.0 * self._variance * noise.step**2)
        quiet = self._table.variance_of(np.minimum(noise.ratio, _QUIET)) / self._variance
        self._level, self._memory = self._means(quiet), np.full(n_groups, float(_FIRST_MEMORY))
        self._learned, self._evidence = self._level.copy(), np.zeros(n_groups)
        self._row, self._least = np.zeros(n, dtype=np.int64), np.zeros(LONGEST_RUN + 1)
        self.found = np.zeros(n, dtype=bool)
        self.record = _Watch(
            n=n,
            n_groups=n_groups,
            shortest_run=SHORTEST_RUN,
            block=_BLOCK,
            alive=_ALIVE,
            is_known=noise.is_known,
            limit=self.limit,
            scatter_limit=self.scatter_limit,
            log_ratio=_LOG_RATIO,
            slope=_SLOPE,
            margin=_MARGIN,
            smallest_scatter=_SMALLEST_SCATTER,
            largest_learned=_LARGEST_LEARNED,
            memory_length=_MEMORY,
            held_evidence=_HELD,
            largest_evidence=_LARGEST_EVIDENCE,
            order=np.concatenate(self._groups).astype(np.int64),
            group_first=np.cumsum([0, *map(len, self._groups)], dtype=np.int64),
            frame=self._frame,
            choices=np.concatenate([_log_choices(len(group)) for group in self._groups]),
            step=np.array(noise.step, dtype=float),
            weight=weight,
            largest=_LARGEST_SQUARE / weight,
            steps_squared=self._means(self._variance),
            log_repeated=self._table.log_repeated,
            log_repeated_zero=self._table.log_repeated_zero,
            row=self._row,
            least=self._least,
            difference=np.full(n, np.nan),
            squares=np.zeros(n),
            counts=np.zeros(n),
            has_moved=np.zeros(n, dtype=bool),
            too_little=np.zeros(n, dtype=bool),
            found=self.found,
            repeating=np.zeros(n, dtype=bool),
            level=self._level,
            learned=self._learned,
            memory=self._memory,
            evidence=self._evidence,
            log_probability=np.zeros(n),
            ranked=np.zeros(n),
            mean=np.zeros(2 * n_groups),
            blocked=0,
            any_too_little=0,
        )
        self._at = pointer(self.record)
        self._scatter, self._find = function("sb_watch_scatter", _Watch), function("sb_watch_find", _Watch)
        self.learn()

    def update(
        self, strain: FloatArray, difference: FloatArray, run: IntArray, present: BoolArray
    ) -> BoolArray | None:
        """Return (n_d,) which gauges are frozen, None if none is.

        Parameters
        ----------
        strain : (n_d,) [m/m].
        difference : (n_d,) change since the last cycle [m/m], NaN where there is none.
        run : (n_d,) number of repetitions of the reading.
        present : (n_d,) gauges of this cycle.
        """
        at_run = pointer(run)
        if self._scatter(self._at, pointer(difference), at_run):
            self.learn()
        is_any = self._find(self._at, pointer(strain), at_run, pointer(present))
        return self.found.copy() if is_any else None

    def learn(self) -> None:
        """Derive from the usual variance which noise is counted on, and the probabilities of repetitions."""
        self._learned[:] = self._level
        # A frame that is dead from the start teaches nothing: the others stand for it.
        level = np.where(self._memory > _FIRST_MEMORY, self._level, self._level[-1])
        usual = np.minimum(_MARGIN * level[self._frame], 1.0)
        self._ratio = np.minimum(_MARGIN * self._table.ratio_of(usual * self._variance), self._noise.ratio)
        self._row[:] = self._table.row(self._ratio)
        smaller = np.minimum(self._table.log_repeated, self._table.log_repeated_zero)
        self._least[SHORTEST_RUN:] = smaller[np.unique(self._row), SHORTEST_RUN:].min(axis=0)

    @property
    def noise_ratio(self) -> FloatArray:
        """(n_d,) noise in quantisation steps that is counted on: stated, or less where less has been seen."""
        return self._ratio

    def log_repeated(self) -> FloatArray:
        """Return the logarithms of the probabilities that stated noise repeats readings: by frame, then of all."""
        of_gauge = self._table.log_repeated[self._table.row(self._noise.ratio), 1]
        return np.array([of_gauge[group].sum() for group in self._groups])

    def _means(self, values: FloatArray) -> FloatArray:
        """Return the means of (n_d,) ``values`` over each frame, and over all gauges."""
        sums = [values[group].sum() for group in self._groups[:-1]]
        return np.array([*sums, sum(sums)]) / [len(group) for group in self._groups]


def _log_choices(n: int) -> FloatArray:
    """Return (n,) the logarithms of the number of choices of k = 1 .. n from n."""
    return np.array([lgamma(n + 1) - lgamma(k + 1) - lgamma(n - k + 1) for k in range(1, n + 1)])
