"""Zeros of the gauges of an FMU: parameters that state them, the flag that asks for a tare, the zeros in use."""

from collections.abc import Sequence
from dataclasses import replace

from strainfmu.estimator.gauge_zeros import LARGEST_ZERO
from strainfmu.estimator.policies import POLICIES
from strainfmu.estimator.signal_names import TARE as TARE
from strainfmu.estimator.signal_names import ZERO, ZERO_COMMON_STD, ZERO_STD
from strainfmu.estimator.tare import TareLimits
from strainfmu.interface.enumerations import TARE_TYPE
from strainfmu.interface.fmi_variables import Variable, depending_on
from strainfmu.interface.health_names import VALID_GAUGES

TARE_STATE = "tare_state"

_ZEROS = ZERO, ZERO_STD, ZERO_COMMON_STD
_ZEROS_IN_USE = "zero_in_use", "zero_in_use_std", "zero_in_use_common_std"
"""Zeros, their standard deviations, and the one in common; the first two one for each gauge."""

ZERO_ARRAYS = {
    ZERO: "Reading of each gauge without strain, taken off its strain; same order as strain",
    ZERO_STD: "Standard deviation of the error of each zero, independent of the others",
    "zero_in_use": "Zero that is subtracted from each strain: the last tare's, or zero; same order as strain",
    "zero_in_use_std": "Standard deviation of the error of each of zero_in_use",
}


def zero_names(n_gauges: int) -> tuple[str, ...]:
    """Return the names of zeros, of their sigmas, and of the sigma that they have in common."""
    return _names(_ZEROS, n_gauges)


def zero_in_use_names(n_gauges: int) -> tuple[str, ...]:
    """Return the names of the zeros in use, of their sigmas, and of the sigma that they have in common."""
    return _names(_ZEROS_IN_USE, n_gauges)


def _names(names: tuple[str, str, str], n_gauges: int) -> tuple[str, ...]:
    *arrays, common = names
    return (*(f"{array}[{i}]" for array in arrays for i in range(1, n_gauges + 1)), common)


def with_zero_parameters(
    interface: Sequence[Variable], gauge_names: Sequence[str], zero_offset: Sequence[float]
) -> tuple[Variable, ...]:
    """Return ``interface`` with the zeros of the gauges behind it, on which all outputs depend but one.

    The zeros start from ``zero_offset``, the map's [m/m]. The number of gauges in use follows from the readings as
    they come.
    """
    common = Variable(
        name=ZERO_COMMON_STD,
        description="Standard deviation of an error that all zeros have in common",
        causality="parameter",
        variability="tunable",
        start=0.0,
    )
    text = "Reading of gauge {gauge} without strain, taken off strain[{i}]"
    zeros = _variables(common, _ZEROS, gauge_names, text, zero_offset)
    outputs = depending_on(interface, zero_names(len(gauge_names)), but=(VALID_GAUGES,), initially=True)
    return (*outputs, *zeros)


def with_tare_variables(interface: Sequence[Variable], gauge_names: Sequence[str]) -> tuple[Variable, ...]:
    """Return ``interface`` with the tare behind it.

    A step or an event takes the flag in; until then no output depends on it.
    """
    limit, fewest = TareLimits().dynamic_pressure, POLICIES.least_samples
    asked = Variable(
        name=TARE,
        description="Strains are averaged while true, and become the zeros in the first step after it; refused "
        f"with fewer than {fewest} steps, or unless dynamic_pressure is known and at most {limit:g} Pa",
        causality="input",
        kind="parameter",
        variability="discrete",
        fmi_type="Boolean",
        start=False,
    )
    state = Variable(
        name=TARE_STATE,
        description="What has become of the last tare",
        causality="output",
        kind="health",
        variability="discrete",
        fmi_type="Enumeration",
        declared_type=TARE_TYPE,
    )
    common = Variable(
        name=_ZEROS_IN_USE[-1],
        description="Standard deviation of an error that all of zero_in_use have in common",
        causality="local",
        variability="discrete",
    )
    text = "Zero of gauge {gauge} that is subtracted from strain[{i}]: the last tare's, or zero[{i}]"
    in_use = _variables(common, _ZEROS_IN_USE, gauge_names, text, [None] * len(gauge_names))
    return (*interface, asked, state, *in_use)


def _variables(
    common: Variable,
    names: tuple[str, str, str],
    gauge_names: Sequence[str],
    text: str,
    start: Sequence[float | None],
) -> list[Variable]:
    """Return zeros, described by ``text``, which ``start`` from values, their sigmas, and the ``common`` one."""
    common = replace(common, kind="parameter", unit="1", display_unit="um/m", minimum=0.0, maximum=LARGEST_ZERO)
    zero, std, _ = names
    values, deviations = list[Variable](), list[Variable]()
    for i, (gauge, value) in enumerate(zip(gauge_names, start, strict=True), start=1):
        described = text.format(gauge=gauge, i=i)
        values.append(
            replace(
                common, name=f"{zero}[{i}]", description=described, minimum=-LARGEST_ZERO, start=value, array=zero
            )
        )
        error = f"Standard deviation of the error of {zero}[{i}], of gauge {gauge}"
        deviations.append(replace(common, name=f"{std}[{i}]", description=error, array=std))
    return [*values, *deviations, common]
