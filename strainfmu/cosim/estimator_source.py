"""Source of an estimator's step: an FMU or a map, opened and closed again."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from math import nan
from pathlib import Path

from strainfmu.arrays import FloatArray
from strainfmu.cosim.fmu_step import FmuStep
from strainfmu.cosim.step import ENVELOPE_SCORE, Step, StepResult
from strainfmu.errors import InputError
from strainfmu.estimator.inverse_map import InverseMap, load_inverse_map
from strainfmu.estimator.manifold.estimator import ManifoldEstimator
from strainfmu.estimator.manifold.tracker import FlightTracker
from strainfmu.estimator.step import Estimator

NAVIGATION = ("mach_number", "altitude")
"""Inputs of an estimator for health alone."""


@dataclass(frozen=True)
class ReadyStep:
    """A step, and the names of its gauges in the order of its strains."""

    step: Step
    gauge_names: tuple[str, ...]


@contextmanager
def open_step(source: Path) -> Iterator[ReadyStep]:
    """Load an estimator FMU or an inverse map; free it at the end.

    Raises
    ------
    InputError
        The file is missing, damaged, or neither.
    StrainfmuError
        The FMU cannot be loaded on this machine.
    """
    if source.suffix.lower() == ".fmu":
        with FmuStep(source, NAVIGATION, (ENVELOPE_SCORE,)) as fmu:
            yield ReadyStep(fmu, fmu.gauge_names)
        return
    if source.suffix.lower() not in (".h5", ".hdf5"):
        raise InputError(f"{source}: expected an estimator FMU (X.fmu) or an inverse map (map.h5)")
    inverse_map = load_inverse_map(source)
    kind = MapStep if inverse_map.manifold is None else FlightStep
    yield ReadyStep(kind(inverse_map), tuple(inverse_map.gauge_names))


class MapStep:
    """The estimator of a map as the step of a bridge."""

    further_inputs = NAVIGATION

    def __init__(self, inverse_map: InverseMap) -> None:
        self._estimator = Estimator(inverse_map)
        self.noise_std = inverse_map.noise_std

    def __call__(
        self,
        strain: FloatArray,
        dynamic_pressure: float,
        step_size: float,
        *,
        mach_number: float = nan,
        altitude: float = nan,
    ) -> StepResult:
        """Do one step; the estimator has no memory, so that ``step_size`` does not matter."""
        found = self._estimator.step(strain, dynamic_pressure, mach_number=mach_number, altitude=altitude)
        return StepResult(
            coefficients=found.coefficients,
            coefficients_std=found.coefficients_std,
            health=int(found.health),
            chi_square=found.chi_square,
            further={ENVELOPE_SCORE: found.envelope_score},
        )


class FlightStep:
    """The nonlinear estimator of a map as the step of a bridge: each step starts from the state of the last."""

    further_inputs = NAVIGATION

    def __init__(self, inverse_map: InverseMap) -> None:
        self._tracker = FlightTracker(ManifoldEstimator(inverse_map))
        self.noise_std = inverse_map.noise_std

    def __call__(
        self,
        strain: FloatArray,
        dynamic_pressure: float,
        step_size: float,
        *,
        mach_number: float = nan,
        altitude: float = nan,
    ) -> StepResult:
        """Do one step; its result does not depend on ``step_size``."""
        found = self._tracker.step(strain, dynamic_pressure, mach_number=mach_number, altitude=altitude)
        return StepResult(
            coefficients=found.coefficients,
            coefficients_std=found.coefficients_std,
            health=int(found.health),
            chi_square=found.chi_square,
            further={ENVELOPE_SCORE: found.envelope_score},
        )
