"""The vehicle as built from a ground test: Gauss-Newton with priors, and Laplace's covariance.

Steps lower the cost |N^-1 (d - d(theta))|^2 + |theta / sigma|^2 over the vehicle's parameters and the errors of
the loads, their length controlled as by Levenberg and Marquardt. Derivatives are kept while steps shrink fast;
a step that raises the cost with new derivatives is damped.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from builder.calibration.estimate.gaussian import GaussianModel
from builder.calibration.estimate.readings_model import ReadingsModel
from builder.structure.as_built.as_built_vehicle import AsBuilt
from builder.structure.as_built.gauge_strain_terms import gain_of
from strainfmu.arrays import BoolArray, FloatArray
from strainfmu.errors import InputError

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


def minimum(
    model: ReadingsModel, used: BoolArray, start: FloatArray | None = None
) -> tuple[FloatArray, GaussianModel, int, bool, tuple[str, float]]:
    """Return where the cost of ``model`` by the readings ``used`` (n_cases, n_d) has its minimum, and how.

    That is the vector; the readings linear about the one before the last step, by what is not known exactly, in
    its standard deviations before the test; the number of steps; whether the last one was shorter than
    :data:`SETTLED`, or than :data:`NEAR` where the cost falls no more; and the parameter that it changes most, by
    how many of its standard deviations after the test. ``start`` (n,) is where they begin; zero by default.
    """
    free = model.std > 0.0
    std = model.std[free]

    def cost(place: FloatArray, predicted: FloatArray) -> float:
        misfit = model.misfit(used, place, predicted)
        return float(misfit @ misfit + np.sum((place[free] / std) ** 2))

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
            downhill = linear.rows.T @ (linear.misfit - linear.rows @ before) - before
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
            farthest = model.names[np.flatnonzero(free)[size.argmax()]]
            return vector, linear, steps, length < short, (farthest, length)
        fresh = lower is None or steps == 1 or damping > 0.0 or not length <= SHRINKS * last
        last = length
        if fresh:
            predicted, jacobian = model.jacobian(vector)


def _moved(vector: FloatArray, free: BoolArray, change: FloatArray) -> FloatArray:
    """Return ``vector`` (n,) with ``change`` added where it is ``free``."""
    changed = vector.copy()
    changed[free] += change
    return changed


FITS = (0.02, 3.0)
"""How far chi-square over its expectation may be from 1: by this much, and so many standard deviations."""

NEAR_DRAWING = 1.0 / 20.0
"""Chi-square over the drawing's from which steps that have not settled found nothing."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Estimate:
    """What a test says of a vehicle and of itself.

    Attributes
    ----------
    model : readings as a function of the vector.
    vector, covariance : (n,) and (n, n) of the model's vector after the test.
    used : (n_cases, n_d) readings that were used.
    before, after : (n_cases, n_d) readings predicted by the drawing, zeros estimated alone, and by the estimate.
    chi_square : of the readings used, but for gauges :attr:`AsBuiltStructure.at_break`, whose error is bounded
        alone; its expectation is :attr:`freedom`.
    steps : Gauss-Newton steps.
    settled : whether they ended at a minimum, to one standard deviation.
    last_step : the parameter that the last one changes most, and by how many standard deviations after the test.
    """

    model: ReadingsModel
    vector: FloatArray
    covariance: FloatArray
    used: BoolArray
    before: FloatArray
    after: FloatArray
    chi_square: float
    steps: int
    settled: bool
    last_step: tuple[str, float]

    @property
    def n_readings(self) -> int:
        return int(self.used.sum())

    @cached_property
    def _learned(self) -> FloatArray:
        """(n, n) what the readings say of the vector: one less covariance after over before the test."""
        std = self.model.std
        scale = np.divide(1.0, std, out=np.zeros_like(std), where=std > 0.0)
        learned = -scale[:, None] * self.covariance
        learned *= scale
        np.einsum("ii->i", learned)[:] += std > 0.0
        return learned

    @cached_property
    def linear(self) -> GaussianModel:
        """Readings and steps, linear about the estimate, by standard deviations before the test."""
        return self.model.linear(self.used, self.vector, self.after, self.model.jacobian(self.vector)[1])

    @property
    def freedom(self) -> float:
        """Readings less what the estimate takes from them: the expectation of ``chi_square``."""
        at_break = self.model.structure.at_break
        if not at_break.any():
            return self.n_readings - float(np.trace(self._learned))
        counted = np.flatnonzero(~at_break[np.argwhere(self.used)[:, 1]])
        rows = self.linear.rows[counted]
        return len(counted) - float((rows.T @ rows).multiply(self.linear.covariance).sum())

    @property
    def per_reading(self) -> float:
        """Chi-square of the readings, priors apart, over its expectation; NaN where none is left to judge by."""
        return self.chi_square / self.freedom if self.freedom >= 1.0 else float("nan")

    @property
    def allowed(self) -> float:
        """How far :attr:`per_reading` may be from 1: it is the sum of squares of normal numbers."""
        square = self.n_readings - 2.0 * np.trace(self._learned) + np.vdot(self._learned, self._learned)
        return FITS[0] + FITS[1] * float(np.sqrt(2.0 * max(square, 0.0))) / max(self.freedom, 1.0)

    @property
    def agrees(self) -> bool:
        """Whether readings and model agree: chi-square is neither too high nor too low."""
        return abs(self.per_reading - 1.0) <= self.allowed

    @property
    def from_priors(self) -> float:
        """Squared distance of the parameters, zeros apart, from what the files state over its expectation; 1
        where tolerances are as stated."""
        counted = ~self.model.is_zero & (self.model.std > 0.0)
        expected = float(np.diag(self._learned)[counted].sum())
        return float(np.sum((self.vector[counted] / self.model.std[counted]) ** 2)) / max(expected, 1e-300)

    @property
    def tolerances_hold(self) -> bool:
        """Whether :attr:`from_priors` is no larger than of a vehicle and loads within their tolerances."""
        counted = ~self.model.is_zero
        learned = self._learned[np.ix_(counted, counted)]
        most = FITS[0] + FITS[1] * float(np.sqrt(2.0 * np.vdot(learned, learned)) / max(np.trace(learned), 1e-300))
        return self.from_priors <= 1.0 + most

    @property
    def unsettled(self) -> str:
        """That the steps did not settle, in one clause; empty where they did."""
        if self.settled:
            return ""
        name, length = self.last_step
        return (
            f"the steps of the estimate did not settle: the last of {self.steps} changes {name} by {length:.2g} "
            "standard deviations; look at the loads, and at gauges near a change of slope or thickness, which "
            "`strainfmu check` names"
        )

    @property
    def disagreement(self) -> str:
        """What a chi-square that does not fit means, in one line; empty where readings and model agree."""
        if self.agrees:
            return ""
        if self.freedom < 1.0:
            return "the test has no more readings than it estimates: whether they fit the model is not known"
        low = self.per_reading < 1.0
        why = (
            "readings are more exact than stated; the sigmas of the map are too large"
            if low
            else "the vehicle errs in a way that the model has no parameter for, or noise or loads are not as "
            "stated; the sigmas of the map need not hold"
        )
        return (
            f"test and model do not agree: chi-square per reading {self.per_reading:.3g} is too "
            f"{'low' if low else 'high'} (1 is expected); {why}"
        )

    @property
    def has_diverged(self) -> bool:
        """Whether the steps found no vehicle: a misfit near the drawing's, or gauges that read the reverse."""
        model, used = self.model, self.used
        misfit = (model.test.readings - self.before)[used] / model.test.reading_stds[used]
        most = float(np.sum(misfit**2)) * (1.0 if self.settled else NEAR_DRAWING)
        as_built = self.parameters
        reads = float(np.median(gain_of(as_built))) / (1.0 + float(as_built.youngs_modulus[0]))
        return not (self.chi_square <= most and reads > 0.0)

    @property
    def far_off(self) -> str:
        """Readings that no vehicle near the drawing has: one factor shows a wrong sign, unit or load."""
        as_stated = self.model.with_pads_of(np.zeros(len(self.vector)))  # the steps' own pads may be anywhere
        drawing, test, changes = as_stated.at_drawing()[0], self.model.test, list[FloatArray]()
        for part in (drawing, test.readings):  # what the loads change, without the zeros
            shown = np.where(self.used, part, 0.0)
            changes.append((shown - _mean_of_group(self.model, self.used, shown))[self.used])
        size = float(changes[0] @ changes[0])
        are = "cannot be compared with the drawing's: too few cases are left; check windows and loads"
        if size > 0.0:
            factor = float(changes[0] @ changes[1]) / size
            are = (
                f"are {factor:.3g} times the drawing's under the stated loads, expected about 1; check signs, "
                "units and loads"
            )
        return (
            f"no vehicle near the drawing has these readings: their changes from case to case {are}"
            f"{'; ' if self.unsettled else ''}{self.unsettled}"
        )

    @property
    def farthest(self) -> tuple[str, float]:
        """The parameter, zeros apart, farthest from its value before the test, in its standard deviations then."""
        std = self.model.std
        counted = (std > 0.0) & ~self.model.is_zero
        size = np.divide(np.abs(self.vector), std, out=np.zeros_like(std), where=counted)
        worst = int(size.argmax())
        return self.model.names[worst], float(size[worst])

    @property
    def parameters(self) -> AsBuilt:
        """The vehicle as built."""
        return self.model.built(self.vector)

    @property
    def std(self) -> FloatArray:
        """(n,) of the vector after the test."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def residuals(self) -> FloatArray:
        """(n_cases, n_d) measured less predicted, in the standard deviations of the readings; NaN if not used."""
        test = self.model.test
        residuals = (test.readings - self.after) / test.reading_stds
        return np.where(self.used, residuals, np.nan)


def usable(model: ReadingsModel) -> BoolArray:
    """Return (n_cases, n_d) whether there is a reading, and not of a check load."""
    return np.asarray(np.isfinite(model.test.readings) & model.test.fitted[:, None])


def estimate(model: ReadingsModel, used: BoolArray, start: FloatArray | None = None) -> Estimate:
    """Estimate the vector of ``model`` from the readings ``used`` (n_cases, n_d).

    ``start`` (n,) is where the steps begin; zero by default.

    Raises
    ------
    InputError
        No reading is left.
    """
    if not used.any():
        raise InputError("load test: no reading is left to calibrate with")
    vector, linear, steps, settled, last_step = minimum(model, used, start)
    test, free = model.test, model.std > 0.0
    reading, noise = test.readings[used], test.reading_stds[used]
    after = model.readings(vector)
    residual = (reading - after[used]) / noise
    full = np.zeros((len(vector), len(vector)))
    full[np.ix_(free, free)] = linear.precision.inverse
    full *= model.std[:, None]
    full *= model.std
    drawing = model.at_drawing()[0]
    return Estimate(
        model=model,
        vector=vector,
        covariance=full,
        used=used,
        before=drawing + _mean_of_group(model, used, np.where(used, test.readings - drawing, 0.0)),
        after=after,
        chi_square=float(np.sum(residual[~model.structure.at_break[np.argwhere(used)[:, 1]]] ** 2)),
        steps=steps,
        settled=settled,
        last_step=last_step,
    )


def _mean_of_group(model: ReadingsModel, used: BoolArray, value: FloatArray) -> FloatArray:
    """Return (n_cases, n_d) the mean of ``value``, 0 of what is not ``used``, over the cases of the same zeros."""
    mean = np.zeros(value.shape)
    for group in model.groups:
        rows = np.array([case.group == group for case in model.test.cases])
        mean[rows] = value[rows].sum(axis=0) / np.maximum(used[rows].sum(axis=0), 1)
    return mean
