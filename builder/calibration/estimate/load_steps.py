"""What steps of loading and unloading show: hysteresis, and how far readings return to zero."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from builder.calibration.ground_test.load_test import LoadCase, LoadTest
from strainfmu.arrays import FloatArray

BEYOND = 3.0
"""Readings that differ by more than this many of their standard deviations do so for another reason than noise."""


@dataclass(frozen=True, eq=False, kw_only=True)
class SteppedCase:
    """A case with steps.

    Attributes
    ----------
    name : of the case.
    part : (n,) of its loads, in the order of time, its own reading at 1 among them [1].
    unloading : (n,) whether each was read after the whole load.
    reading : (n, n_d) [m/m].
    reading_std : (n, n_d) of it [m/m].
    """

    name: str
    part: FloatArray
    unloading: np.ndarray
    reading: FloatArray
    reading_std: FloatArray

    @property
    def span(self) -> FloatArray:
        """(n_d,) largest reading less the smallest [m/m]."""
        return np.asarray(np.ptp(self.reading, axis=0))

    @property
    def hysteresis(self) -> FloatArray:
        """(n, n_d) unloading less loading at the same part of the loads [m/m]; no rows where no part has both."""
        return self._differences(self.reading)[0]

    @property
    def hysteresis_std(self) -> FloatArray:
        """(n, n_d) of that, by noise [m/m]."""
        return self._differences(self.reading)[1]

    @property
    def return_to_zero(self) -> FloatArray | None:
        """(n_d,) the last reading without load less the first one [m/m]; None without both."""
        ends = self._without_load
        return None if ends is None else np.asarray(self.reading[ends[1]] - self.reading[ends[0]])

    @property
    def return_to_zero_std(self) -> FloatArray | None:
        """(n_d,) of that, by noise [m/m]."""
        ends = self._without_load
        return None if ends is None else np.asarray(np.hypot(*self.reading_std[list(ends)]))

    @property
    def _without_load(self) -> tuple[int, int] | None:
        """First and last reading without load, on both sides of the whole load; None without both."""
        none = np.flatnonzero(self.part == 0.0)
        before, after = none[~self.unloading[none]], none[self.unloading[none]]
        return (int(before[0]), int(after[-1])) if len(before) and len(after) else None

    def _differences(self, reading: FloatArray) -> tuple[FloatArray, FloatArray]:
        found, std = [], []
        for k in np.flatnonzero(self.unloading):
            same = np.flatnonzero(~self.unloading & np.isclose(self.part, self.part[k], atol=1e-3))
            if len(same) and self.part[k] > 0.0:
                found.append(reading[k] - reading[same[-1]])
                std.append(np.hypot(self.reading_std[k], self.reading_std[same[-1]]))
        shape = (0, reading.shape[1])
        return np.array(found).reshape(-1, *shape[1:]), np.array(std).reshape(-1, *shape[1:])


def stepped_cases(test: LoadTest) -> list[SteppedCase]:
    """Return the cases that have steps."""
    return [_stepped(case) for case in test.cases if case.steps]


def _stepped(case: LoadCase) -> SteppedCase:
    loading = [one for one in case.steps if not one.unloading]
    unloading = [one for one in case.steps if one.unloading]
    return SteppedCase(
        name=case.name,
        part=np.array([*(one.part for one in loading), 1.0, *(one.part for one in unloading)]),
        unloading=np.array([False] * (len(loading) + 1) + [True] * len(unloading)),
        reading=np.array([*(one.reading for one in loading), case.reading, *(one.reading for one in unloading)]),
        reading_std=np.array(
            [*(one.reading_std for one in loading), case.reading_std, *(one.reading_std for one in unloading)]
        ),
    )


def step_remarks(test: LoadTest) -> tuple[str, ...]:
    """Return a line where readings do not repeat as exactly as they are stated."""
    cases = stepped_cases(test)
    lines = list[str]()
    zero = [
        (case.name, case.return_to_zero, case.return_to_zero_std)
        for case in cases
        if case.return_to_zero is not None and case.return_to_zero_std is not None
    ]
    lines += _remark("do not return to zero", zero)
    pairs = [
        (case.name, value, std)
        for case in cases
        for value, std in zip(case.hysteresis, case.hysteresis_std, strict=True)
    ]
    return (*lines, *_remark("differ between loading and unloading", pairs))


def _remark(what: str, rows: Sequence[tuple[str, FloatArray, FloatArray]]) -> list[str]:
    if not rows:
        return []
    value, std = np.array([row[1] for row in rows]), np.array([row[2] for row in rows])
    rms, noise = (float(np.sqrt(np.nanmean(one**2))) for one in (value, std))
    if not rms > BEYOND * noise:
        return []
    worst = int(np.nanargmax(np.sqrt(np.nanmean(value**2, axis=1))))
    return [
        f"readings {what}: {1e6 * rms:.2g} um/m rms, {rms / noise:.1f} times their noise, most in case "
        f"'{rows[worst][0]}'; expected readings.reading_std_um_per_m of about {1e6 * rms / np.sqrt(2.0):.2g}"
    ]
