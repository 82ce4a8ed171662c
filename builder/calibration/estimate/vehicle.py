"""The vehicle as built from a ground test: Gauss-Newton with priors, and Laplace's covariance.

Minimises |N^-1 (d - d(theta))|^2 + |theta / sigma|^2 over the vehicle's parameters and the errors of the loads.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from builder.calibration.estimate.readings_model import ReadingsModel
from builder.calibration.estimate.steps import minimum
from builder.structure.as_built.gauges import gain_of
from builder.structure.as_built.vehicle import AsBuilt
from strainfmu.arrays import BoolArray, FloatArray
from strainfmu.errors import InputError

FITS = (0.02, 3.0)
"""Chi-square per reading within which test and model agree: 1 by this much, and so many standard deviations.

None of 128 tests of vehicles on another mesh left it."""


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
    chi_square : of readings and priors together; its expectation is ``n_readings``.
    steps : Gauss-Newton steps.
    settled : whether they ended at a minimum, to one standard deviation.
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

    @property
    def n_readings(self) -> int:
        return int(self.used.sum())

    @property
    def per_reading(self) -> float:
        """Chi-square per reading; 1 is expected."""
        return self.chi_square / self.n_readings

    @property
    def agrees(self) -> bool:
        """Whether test and model agree: chi-square is neither too high nor too low."""
        return abs(self.per_reading - 1.0) <= FITS[0] + FITS[1] * float(np.sqrt(2.0 / self.n_readings))

    @property
    def disagreement(self) -> str:
        """What a chi-square that does not fit means, in one line; empty where test and model agree."""
        if self.agrees:
            return ""
        low = self.per_reading < 1.0
        why = (
            "readings are more exact than stated or tolerances too wide; the sigmas of the map are too large"
            if low
            else "the vehicle errs in a way that the model has no parameter for, or noise, loads or tolerances "
            "are not as stated; the sigmas of the map need not hold"
        )
        return (
            f"test and model do not agree: chi-square per reading {self.per_reading:.3g} is too "
            f"{'low' if low else 'high'} (1 is expected); {why}"
        )

    @property
    def has_diverged(self) -> bool:
        """Whether the steps found no vehicle: a misfit near the drawing's, or gauges that read the reverse."""
        model, used = self.model, self.used
        left = (model.test.readings - drawing_readings(model, used))[used] / model.test.reading_stds[used]
        most = float(np.sum(left**2)) * (1.0 if self.settled else NEAR_DRAWING)
        built = self.parameters
        reads = float(np.median(gain_of(built))) / (1.0 + float(built.youngs_modulus[0]))
        return not (self.chi_square <= most and reads > 0.0)

    @property
    def far_off(self) -> str:
        """Readings that no vehicle near the drawing has: one factor shows a wrong sign, unit or load."""
        drawing, test, changes = self.model.at_drawing()[0], self.model.test, []
        for part in (drawing, test.readings):
            seen = np.where(self.used, part, 0.0)
            for group in self.model.groups:  # what the loads change, without the zeros
                rows = np.array([case.group == group for case in test.cases])
                seen[rows] -= seen[rows].sum(axis=0) / np.maximum(self.used[rows].sum(axis=0), 1)
            changes.append(seen[self.used])
        size = float(changes[0] @ changes[0])
        factor = float(changes[0] @ changes[1]) / size if size > 0.0 else float("nan")
        return (
            "no vehicle near the drawing has these readings: their changes from case to case are "
            f"{factor:.3g} times the drawing's under the stated loads, expected about 1; "
            "check signs, units and loads"
        )

    @property
    def farthest(self) -> tuple[str, float]:
        """The parameter farthest from its value before the test, and how far in its standard deviations then."""
        std = self.model.std
        size = np.divide(np.abs(self.vector), std, out=np.zeros_like(std), where=std > 0.0)
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
        found = (test.readings - self.after) / test.reading_stds
        return np.where(self.used, found, np.nan)


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
    end = minimum(model, used, start)
    vector, covariance = end.vector, end.covariance
    test, free = model.test, model.std > 0.0
    reading, noise = test.readings[used], test.reading_stds[used]
    after = model.readings(vector)
    misfit = float(np.sum(((reading - after[used]) / noise) ** 2))
    full = np.zeros((len(vector), len(vector)))
    full[np.ix_(free, free)] = model.std[free][:, None] * covariance * model.std[free]
    return Estimate(
        model=model,
        vector=vector,
        covariance=full,
        used=used,
        before=drawing_readings(model, used),
        after=after,
        chi_square=misfit + float(np.sum((vector[free] / model.std[free]) ** 2)),
        steps=end.steps,
        settled=end.settled,
    )


def drawing_readings(model: ReadingsModel, used: BoolArray) -> FloatArray:
    """Return what the vehicle of the drawing reads (n_cases, n_d), its zeros the mean of what is left."""
    predicted = model.at_drawing()[0].copy()
    left = np.where(used, model.test.readings - predicted, 0.0)
    for group in model.groups:
        rows = np.array([case.group == group for case in model.test.cases])
        count = np.maximum(used[rows].sum(axis=0), 1)
        predicted[rows] += left[rows].sum(axis=0) / count
    return predicted
