"""One step of an estimator, an FMU or a map: strains and dynamic pressure in, coefficients out."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError, StrainfmuError
from strainfmu.estimator.health import HealthState


class StepRefused(StrainfmuError):
    """The FMU could not do this one step; the next may be tried."""


@dataclass(frozen=True, eq=False)
class StepResult:
    """Outputs of one step of the estimator.

    Attributes
    ----------
    coefficients, coefficients_std : (5,) C_A, C_N, C_Y, M_P, M_Y and their standard deviations [1].
    health : ``health.state``, a number of :class:`HealthState`.
    chi_square : ``health.chi_square`` [1].
    """

    coefficients: FloatArray
    coefficients_std: FloatArray
    health: int
    chi_square: float


def health_name(state: int) -> str:
    """Return the name of a state of health, its number if this version does not know it."""
    return HealthState(state).name if state in set(HealthState) else str(state)


Step = Callable[[FloatArray, float, float], StepResult]
"""(n_d,) strains [m/m], NaN where not valid; q_inf [Pa], NaN if not known; step size [s]. Raises StepRefused."""


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
        from strainfmu.cosim.fmu_step import FmuStep

        with FmuStep(source) as fmu:
            yield ReadyStep(fmu, fmu.gauge_names)
        return
    if source.suffix.lower() not in (".h5", ".hdf5"):
        raise InputError(f"{source}: expected an estimator FMU (X.fmu) or an inverse map (map.h5)")
    from strainfmu.estimator.inverse_map import load_inverse_map
    from strainfmu.estimator.step import Estimator

    inverse_map = load_inverse_map(source)
    estimator = Estimator(inverse_map)

    def step(strain: FloatArray, dynamic_pressure: float, step_size: float) -> StepResult:
        found = estimator.step(strain, dynamic_pressure)
        return StepResult(
            coefficients=found.coefficients,
            coefficients_std=found.coefficients_std,
            health=int(found.health),
            chi_square=found.chi_square,
        )

    yield ReadyStep(step, tuple(inverse_map.gauge_names))
