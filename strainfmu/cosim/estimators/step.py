"""Step of an estimator, as bridge and recorded data take it: strains and dynamic pressure in, coefficients out."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from strainfmu.arrays import FloatArray
from strainfmu.errors import StrainfmuError
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.other_loads import LoadGroup
from strainfmu.estimator.settings import OF_READINGS, SENSOR_RANGE
from strainfmu.interface.health_names import ENVELOPE_SCORE as ENVELOPE_SCORE
from strainfmu.interface.parameter_variables import PREFIX as PARAMETER_PREFIX
from strainfmu.interface.parameter_variables import STD_PREFIX


class StepRefused(StrainfmuError):
    """The FMU could not do this one step; the next may be tried."""


@dataclass(eq=False, slots=True)  # not frozen: one is made for every cycle, and that costs thrice
class StepResult:
    """Outputs of one step of the estimator.

    Attributes
    ----------
    coefficients, coefficients_std : (5,) C_A, C_N, C_Y, M_P, M_Y and their standard deviations [1].
    health : ``health.state``, a number of :class:`HealthState`.
    chi_square : ``health.chi_square`` [1].
    other_outputs : other outputs that were asked for, by name.
    """

    coefficients: FloatArray
    coefficients_std: FloatArray
    health: int
    chi_square: float
    other_outputs: Mapping[str, float] = field(default_factory=dict)


_HEALTH_NAMES = {int(state): state.name for state in HealthState}


def health_name(state: int) -> str:
    """Return the name of a state of health, its number if this version does not know it."""
    return _HEALTH_NAMES.get(state, str(state))


PARAMETERS = "parameters"
"""Name that stands for all flow parameters among the other inputs that are asked for, and their
standard deviations."""

OTHER_LOAD_OUTPUTS = "other_loads"
"""Name that stands for the loads behind the five, with their standard deviations, among the outputs asked for."""

Step = Callable[..., StepResult]
"""(n_d,) strains [m/m], NaN where not valid; q_inf [Pa], NaN if not known; step size [s]; values of
:func:`other_inputs` by name, NaN if not known. Raises StepRefused."""


def other_inputs(step: Step) -> tuple[str, ...]:
    """Return the inputs that ``step`` takes by name: its attribute ``other_inputs``, or none."""
    return tuple(getattr(step, "other_inputs", ()))


def needs_pressure(step: Step) -> bool:
    """Return whether ``step`` has no coefficients where q_inf is not known.

    It is ``step``'s attribute ``needs_pressure``, False of a nonlinear estimator; True where it has none.
    """
    return bool(getattr(step, "needs_pressure", True))


def takes_mask(step: Step) -> bool:
    """Return whether ``step`` takes the mask of valid gauges, bytes of (n_d,) bool, behind the step size.

    It is ``step``'s attribute ``takes_mask``; False where it has none.
    """
    return bool(getattr(step, "takes_mask", False))


def sensor_names_of(step: Step) -> tuple[str, ...]:
    """Return the temperature sensors whose inputs ``temperature[k]`` are among :func:`other_inputs`, in order.

    They are ``step``'s attribute ``sensor_names``; none where it has none.
    """
    return tuple(getattr(step, "sensor_names", ()))


def reading_units_of(step: Step) -> dict[str, str]:
    """Return the unit of each auxiliary sensor and of thrust among :func:`other_inputs` by name of the input.

    They are ``step``'s attribute ``reading_units``; none where it has none.
    """
    return dict(getattr(step, "reading_units", {}))


def parameter_names_of(step: Step) -> tuple[str, ...]:
    """Return the inputs ``parameter.NAME`` of flow parameters among :func:`other_inputs`."""
    return tuple(name for name in other_inputs(step) if name.startswith(PARAMETER_PREFIX))


def parameter_std_names_of(step: Step) -> tuple[str, ...]:
    """Return the inputs ``parameter_std.NAME`` of their standard deviations among :func:`other_inputs`."""
    return tuple(name for name in other_inputs(step) if name.startswith(STD_PREFIX))


def load_groups_of(step: Step) -> tuple[LoadGroup, ...]:
    """Return the groups of the loads behind the five that ``step`` gives.

    They are ``step``'s attribute ``load_groups``, none where it has none; the loads are in
    :attr:`StepResult.other_outputs`.
    """
    return tuple(getattr(step, "load_groups", ()))


def noise_of(step: Step) -> FloatArray | None:
    """Return (n_d,) the standard deviations of the gauges' noise [m/m] by which the estimator was made.

    They are ``step``'s attribute ``noise_std``; None where it has none.
    """
    noise: FloatArray | None = getattr(step, "noise_std", None)
    return noise


def sensor_range_of(step: Step) -> float:
    """Return the largest |strain| of a gauge that the estimator uses [m/m].

    It is ``step``'s attribute ``sensor_range``; the value of maps where it has none.
    """
    return float(getattr(step, OF_READINGS, SENSOR_RANGE))
