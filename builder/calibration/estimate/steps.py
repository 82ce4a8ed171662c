"""Gauss-Newton steps to the vehicle as built, with Levenberg and Marquardt's control of their length.

What falls at every step but the last is the cost |N^-1 (d - d(theta))|^2 + |theta / sigma|^2. Derivatives are
kept while steps shrink fast, else they are renewed; a step that raises the cost with new derivatives is damped.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from builder.calibration.estimate.readings_model import ReadingsModel
from strainfmu.arrays import BoolArray, FloatArray

STEPS = 20
"""Most steps; sound tests of vehicles drawn from the tolerances need 3 to 7."""

SETTLED = 0.1
"""Largest change of a parameter, in its standard deviations after the test, that ends the steps."""

NEAR = 1.0
"""The same where the cost falls no more, or too slowly."""

SHRINKS = 0.5
"""Length of a step over the last one up to which the derivatives are kept."""

SURE, WORTH = 6, 1e-3
"""Steps after which a relative fall of the cost by less than this ends them: readings that no vehicle fits have a
flat minimum."""

FIRST_DAMPING, MORE_DAMPING, TRIALS = 1e-3, 4.0, 12
"""First damping, over the diagonal of the precision, factor of the next one, and most of them at one step."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Minimum:
    """Where the steps ended.

    Attributes
    ----------
    vector : (n,) of the model.
    covariance : (n_free, n_free) of what is not known exactly, in its standard deviations before the test.
    steps : number of steps.
    settled : whether the last step was shorter than :data:`SETTLED`, or than :data:`NEAR` where the cost falls no
        more.
    length : of the last step: its largest change of a parameter, in the standard deviations after the test.
    farthest : number of that parameter in the vector.
    """

    vector: FloatArray
    covariance: FloatArray
    steps: int
    settled: bool
    length: float
    farthest: int


def minimum(model: ReadingsModel, used: BoolArray, start: FloatArray | None = None) -> Minimum:
    """Return where the cost of ``model`` by the readings ``used`` (n_cases, n_d) has its minimum.

    ``start`` (n,) is where the steps begin; zero by default.
    """
    cost = _Cost(model, used)
    vector = np.zeros(len(model.std)) if start is None else start * cost.free
    predicted, jacobian = model.at_drawing() if start is None else model.jacobian(vector)
    steps, value, last, damping = 0, cost.of(vector, predicted), np.inf, 0.0
    fresh = True  # whether the derivatives are of this vector
    while True:
        steps += 1
        step = _Step(cost, vector, predicted, jacobian)
        if step.length < SETTLED:
            return step.end(step.taken(vector, 0.0), steps, SETTLED)
        found = _lower(cost, step, vector, value, damping, TRIALS if fresh else 1)
        fall = step.predicted_fall if found is None else value - found.value
        flat = steps >= SURE and fresh and fall < WORTH * value
        if found is not None:
            vector, predicted, value = found.vector, found.predicted, found.value
            damping = found.damping / MORE_DAMPING if found.damping > FIRST_DAMPING else 0.0
        if steps == STEPS or flat or (found is None and fresh):
            return step.end(vector, steps, NEAR)
        fresh = found is None or steps == 1 or damping > 0.0 or not step.length <= SHRINKS * last
        last = step.length
        if fresh:
            predicted, jacobian = model.jacobian(vector)


class _Cost:
    """Misfit of readings and prior."""

    def __init__(self, model: ReadingsModel, used: BoolArray) -> None:
        self.model, self.used, self.free = model, used, model.std > 0.0
        self.std = model.std[self.free]
        self.reading, self.noise = model.test.readings[used], model.test.reading_stds[used]

    def of(self, vector: FloatArray, predicted: FloatArray) -> float:
        left = (self.reading - predicted[self.used]) / self.noise
        return float(left @ left + np.sum((vector[self.free] / self.std) ** 2))


class _Step:
    """One step of Gauss and Newton, and the damped ones of the same derivatives.

    Attributes
    ----------
    covariance : of the parameters that are not known exactly, in their standard deviations before the test.
    change : (n_free,) of the step without damping.
    length : its largest change of a parameter, in the standard deviations after the test.
    """

    def __init__(self, cost: _Cost, vector: FloatArray, predicted: FloatArray, jacobian: FloatArray) -> None:
        used, free, std = cost.used, cost.free, cost.std
        self._cost, before = cost, vector[free]
        rows = jacobian[used][:, free] * (std / cost.noise[:, None])
        target = (cost.reading - predicted[used]) / cost.noise + rows @ (before / std)
        self._precision = rows.T @ rows + np.eye(rows.shape[1])
        self.covariance = np.asarray(np.linalg.inv(self._precision), dtype=np.float64)
        self.change = self.covariance @ (rows.T @ target) * std - before
        self._downhill = rows.T @ (target - rows @ (before / std)) - before / std
        size = np.abs(self.change) / (std * np.sqrt(np.diag(self.covariance)))
        self.length, self._farthest = float(np.max(size)), int(np.flatnonzero(free)[size.argmax()])

    @property
    def predicted_fall(self) -> float:
        """What the cost falls by without damping, if the readings are linear."""
        return float(self._downhill @ (self.change / self._cost.std))

    def end(self, vector: FloatArray, steps: int, short: float) -> Minimum:
        """Return ``vector`` as the end of the steps, settled where this last one is shorter than ``short``."""
        return Minimum(
            vector=vector,
            covariance=self.covariance,
            steps=steps,
            settled=self.length < short,
            length=self.length,
            farthest=self._farthest,
        )

    def taken(self, vector: FloatArray, damping: float) -> FloatArray:
        """Return ``vector`` (n,) after the step."""
        change = self.change
        if damping > 0.0:
            damped = self._precision + damping * np.diag(np.diag(self._precision))
            change = np.linalg.solve(damped, self._downhill) * self._cost.std
        found = vector.copy()
        found[self._cost.free] += change
        return found


@dataclass(frozen=True, eq=False, kw_only=True)
class _Lower:
    """A vector of lower cost, its readings, its cost, and the damping that led there."""

    vector: FloatArray
    predicted: FloatArray
    value: float
    damping: float


def _lower(
    cost: _Cost, step: _Step, vector: FloatArray, value: float, damping: float, trials: int
) -> _Lower | None:
    """Return the first vector of lower cost than ``value`` as damping grows; None after so many trials."""
    for _ in range(trials):
        trial = step.taken(vector, damping)
        predicted = cost.model.readings(trial)
        there = cost.of(trial, predicted)
        if there < value:
            return _Lower(vector=trial, predicted=predicted, value=there, damping=damping)
        damping = max(FIRST_DAMPING, MORE_DAMPING * damping)
    return None
