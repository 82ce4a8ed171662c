"""What steps of loading and unloading show: the curve of the load cell, hysteresis, the return to zero.

Strain is linear in the loads. So the change of the readings at a step, along their change s under the whole load,

    a = s' W (reading - zero) / s' W s,

is the part of the load that acted, to 1e-4 with fifty gauges, and a over the stated part is 1 but for the errors
of the load cell. W weighs by the noise; zeros are linear between the readings without load on both sides. The
scatter of steps about the curve of their cell is estimated: it has the errors of single readings of the load.
Source of the practice: AIAA R-091, Calibration and use of internal strain-gage balances.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq

from builder.calibration.ground_test.load_changes import cell_force
from builder.calibration.ground_test.load_test import LoadCase, LoadStep, LoadTest
from strainfmu.arrays import BoolArray, FloatArray

FEWEST = 4
"""Steps beyond the parameters of a curve from which their scatter is estimated."""

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
    def same_load(self) -> list[tuple[int, int]]:
        """Numbers of readings at the same part of the loads, on the way to them and back."""
        pairs = list[tuple[int, int]]()
        for k in np.flatnonzero(self.unloading & (self.part > 0.0)):
            same = np.flatnonzero(~self.unloading & np.isclose(self.part, self.part[k], atol=1e-3))
            pairs += [(int(same[-1]), int(k))] if len(same) else []
        return pairs

    @property
    def without_load(self) -> list[tuple[int, int]]:
        """Numbers of the first and last reading without load, on both sides of the whole load, where both are."""
        none = np.flatnonzero(self.part == 0.0)
        before, after = none[~self.unloading[none]], none[self.unloading[none]]
        return [(int(before[0]), int(after[-1]))] if len(before) and len(after) else []

    def change(self, pairs: Sequence[tuple[int, int]]) -> tuple[FloatArray, FloatArray]:
        """Return (n, n_d) the second reading of each pair less the first, and its standard deviation by noise
        [m/m]."""
        first, second = np.array(pairs, dtype=np.intp).reshape(-1, 2).T
        return self.reading[second] - self.reading[first], np.hypot(
            self.reading_std[second], self.reading_std[first]
        )


def stepped_cases(test: LoadTest) -> list[SteppedCase]:
    """Return the cases that have steps."""
    return [_stepped(case) for case in test.cases if case.steps]


def _stepped(case: LoadCase) -> SteppedCase:
    own = LoadStep(part=1.0, unloading=False, reading=case.reading, reading_std=case.reading_std)
    readings = [*(step for step in case.steps if not step.unloading), own]
    readings += [step for step in case.steps if step.unloading]
    return SteppedCase(
        name=case.name,
        part=np.array([step.part for step in readings]),
        unloading=np.array([step.unloading for step in readings]),
        reading=np.array([step.reading for step in readings]),
        reading_std=np.array([step.reading_std for step in readings]),
    )


class StepParts(NamedTuple):
    """Steps (m,) by their load cell and the force of the whole load [N].

    Attributes
    ----------
    part : of the whole load, as stated [1].
    value, std : part by the readings over ``part``, less 1, and its standard deviation [1].
    """

    cell: list[str]
    force: FloatArray
    part: FloatArray
    value: FloatArray
    std: FloatArray


def step_parts(test: LoadTest, used: BoolArray) -> StepParts:
    """Return the steps of the cases ``used`` (n_cases,) whose forces one load cell reads, and that have readings
    without load."""
    cells, rows = list[str](), list[list[float]]()
    for case, is_used in zip(test.cases, used, strict=True):
        on = [known for known in case.loads if known.on_load_cell and cell_force(known.load) > 0.0]
        if is_used and case.steps and len(on) == 1:
            of_case = _parts_of(_stepped(case))
            rows += [[cell_force(on[0].load), *row, on[0].std] for row in of_case]
            cells += [on[0].load_cell] * len(of_case)
    force, part, value, std, load = np.array(rows).reshape(-1, 5).T
    for cell in dict.fromkeys(cells):
        places = np.flatnonzero([name == cell for name in cells])
        curve = np.vander(part[places] * force[places], 3)[:, :2] - np.vander(force[places], 3)[:, :2]
        curve = np.column_stack(
            [curve / np.maximum(np.abs(curve).max(axis=0), 1e-300), 1.0 / (part[places] * force[places])]
        )
        std[places] = np.hypot(
            std[places], _own_scatter(curve, value[places], std[places], float(load[places].max()))
        )
    return StepParts(cells, force, part, value, std)


def _own_scatter(curve: FloatArray, value: FloatArray, std: FloatArray, stated: float) -> float:
    """Return the scatter of ``value`` (m,) about ``curve`` (m, 3) in addition to ``std`` (m,); where there are too
    few to show it, what is ``stated``."""
    freedom = len(value) - curve.shape[1]
    if freedom < FEWEST:
        return stated
    rest = value - curve @ np.linalg.lstsq(curve / std[:, None], value / std)[0]

    def excess(scatter: float) -> float:
        return float(np.sum(rest**2 / (std**2 + scatter**2))) - freedom

    return 0.0 if excess(0.0) <= 0.0 else float(brentq(excess, 0.0, np.linalg.norm(rest)))


def _parts_of(case: SteppedCase) -> list[tuple[float, float, float]]:
    """Return part, part by the readings over it less 1, and its standard deviation by noise, of each step."""
    none, full_load = np.flatnonzero(case.part == 0.0), int(np.count_nonzero(~case.unloading)) - 1
    good = np.isfinite(case.reading).all(axis=0)
    if not len(none) or not good.any():
        return []
    order, reading = np.arange(len(case.part)), case.reading[:, good]
    zero = np.array([np.interp(order, none, column) for column in reading[none].T]).T
    weight = 1.0 / np.mean(case.reading_std[:, good] ** 2, axis=0)
    change = reading - zero
    size = float(change[full_load] ** 2 @ weight)
    some = np.flatnonzero((case.part > 0.0) & (order != full_load))
    ratio = change[some] @ (weight * change[full_load]) / size / case.part[some] - 1.0
    noise = np.sqrt((2.0 + case.part[some] ** 2) / size) / case.part[some]
    return list(zip(case.part[some].tolist(), ratio.tolist(), noise.tolist(), strict=True))


def step_remarks(test: LoadTest) -> tuple[str, ...]:
    """Return a line where readings do not repeat as exactly as they are stated."""
    cases = stepped_cases(test)
    return (
        *_remark("do not return to zero", [(case, case.without_load) for case in cases]),
        *_remark("differ between loading and unloading", [(case, case.same_load) for case in cases]),
    )


def _remark(what: str, pairs: Sequence[tuple[SteppedCase, list[tuple[int, int]]]]) -> list[str]:
    changes = [(case.name, *row) for case, of_case in pairs for row in zip(*case.change(of_case), strict=True)]
    if not changes:
        return []
    value, std = np.array([row[1] for row in changes]), np.array([row[2] for row in changes])
    rms, noise = (float(np.sqrt(np.nanmean(values**2))) for values in (value, std))
    if not rms > BEYOND * noise:
        return []
    worst = int(np.nanargmax(np.sqrt(np.nanmean(value**2, axis=1))))
    return [
        f"readings {what}: {1e6 * rms:.2g} um/m rms, {rms / noise:.1f} times their noise, most in case "
        f"'{changes[worst][0]}'; expected readings.reading_std_um_per_m of about {1e6 * rms / np.sqrt(2.0):.2g}"
    ]
