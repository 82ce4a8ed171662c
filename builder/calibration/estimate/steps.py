"""Gauss-Newton steps to the vehicle as built, with Levenberg and Marquardt's control of their length.

What falls at every step but the last is the cost |N^-1 (d - d(theta))|^2 + |theta / sigma|^2. Derivatives are
kept while steps shrink fast, else they are renewed; a step that raises the cost with new derivatives is damped.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from builder.calibration.estimate.gaussian import GaussianModel
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
    linear : readings about the vector before the last step, by what is not known exactly, in its standard
        deviations before the test.
    steps : number of steps.
    settled : whether the last step was shorter than :data:`SETTLED`, or than :data:`NEAR` where the cost falls no
        more.
    length : of the last step: its largest change of a parameter, in the standard deviations after the test.
    farthest : number of that parameter in the vector.
    """

    vector: FloatArray
    linear: GaussianModel
    steps: int
    settled: bool
    length: float
    farthest: int


def minimum(model: ReadingsModel, used: BoolArray, start: FloatArray | None = None) -> Minimum:
    """Return where the cost of ``model`` by the readings ``used`` (n_cases, n_d) has its minimum.

    ``start`` (n,) is where the steps begin; zero by default.
    """
    free = model.std > 0.0
    std = model.std[free]

    def cost(at: FloatArray, predicted: FloatArray) -> float:
        left = model.left(used, at, predicted)
        return float(left @ left + np.sum((at[free] / std) ** 2))

    vector = np.zeros(len(model.std)) if start is None else start * free
    predicted, jacobian = model.at_drawing() if start is None else model.jacobian(vector)
    steps, value, last, damping = 0, cost(vector, predicted), np.inf, 0.0
    fresh = True  # whether the derivatives are of this vector
    while True:
        steps += 1
        linear = model.linear(used, vector, predicted, jacobian)
        before = vector[free] / std
        change = linear.mean - before
        size = np.abs(change) / linear.std
        length, short = float(size.max()), SETTLED
        ended = length < SETTLED
        if ended:
            vector = _moved(vector, free, change * std)
        else:
            downhill = linear.rows.T @ (linear.left - linear.rows @ before) - before
            lower, fall = None, float(downhill @ change)  # what the cost falls by if readings are linear
            for _ in range(TRIALS if fresh else 1):
                step = change if damping == 0.0 else linear.precision_at(damping=damping).solve(downhill)
                trial = _moved(vector, free, step * std)
                of_trial = model.readings(trial)
                lower = cost(trial, of_trial)
                if lower < value:
                    break
                lower, damping = None, max(FIRST_DAMPING, MORE_DAMPING * damping)
            flat = steps >= SURE and fresh and (fall if lower is None else value - lower) < WORTH * value
            ended, short = steps == STEPS or flat or (lower is None and fresh), NEAR
            if lower is not None:
                vector, predicted, value = trial, of_trial, lower
                damping = damping / MORE_DAMPING if damping > FIRST_DAMPING else 0.0
            elif not fresh:
                damping = 0.0
        if ended:
            return Minimum(
                vector=vector,
                linear=linear,
                steps=steps,
                settled=length < short,
                length=length,
                farthest=int(np.flatnonzero(free)[size.argmax()]),
            )
        fresh = lower is None or steps == 1 or damping > 0.0 or not length <= SHRINKS * last
        last = length
        if fresh:
            predicted, jacobian = model.jacobian(vector)


def _moved(vector: FloatArray, free: BoolArray, change: FloatArray) -> FloatArray:
    """Return ``vector`` (n,) with ``change`` added where it is ``free``."""
    found = vector.copy()
    found[free] += change
    return found
