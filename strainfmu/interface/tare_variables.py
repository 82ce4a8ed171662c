"""What an FMU has for a tare: the flag that asks for it, what became of it, and the zeros in use."""

from __future__ import annotations

from collections.abc import Sequence

from strainfmu.estimator.gauge_zeros import LARGEST_ZERO
from strainfmu.estimator.signal_names import TARE as TARE
from strainfmu.estimator.tare import LEAST_SAMPLES, TareLimits
from strainfmu.interface.enumerations import TARE_TYPE
from strainfmu.interface.fmi_variables import Variable

TARE_STATE = "tare_state"

ZEROS_IN_USE = ("zero_in_use", "zero_in_use_std", "zero_in_use_common_std")
"""Zeros, their standard deviations, and the one in common; the first two one for each gauge."""

TARE_ARRAYS = {
    "zero_in_use": "Zero that is subtracted from each strain: the last tare's, or zero; same order as strain",
    "zero_in_use_std": "Standard deviation of the error of each of zero_in_use",
}


def zero_in_use_names(n_gauges: int) -> tuple[str, ...]:
    """Return the names of the zeros in use, of their sigmas, and of the sigma that they have in common."""
    value, std, common = ZEROS_IN_USE
    numbers = range(1, n_gauges + 1)
    return (*(f"{value}[{i}]" for i in numbers), *(f"{std}[{i}]" for i in numbers), common)


def with_tare_variables(interface: Sequence[Variable], gauge_names: Sequence[str]) -> tuple[Variable, ...]:
    """Return ``interface`` with the tare behind it.

    A step or an event takes the flag in; until then no output depends on it.
    """
    limit = TareLimits().dynamic_pressure
    asked = Variable(
        name=TARE,
        description="Strains are averaged while true, and become the zeros in the first step after it; refused "
        f"with fewer than {LEAST_SAMPLES} steps, or unless dynamic_pressure is known and at most {limit:g} Pa",
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
    names = zero_in_use_names(len(gauge_names))
    return (*interface, asked, state, *(_in_use(name, gauge_names) for name in names))


def _in_use(name: str, gauge_names: Sequence[str]) -> Variable:
    array, _, index = name.partition("[")
    text = "Standard deviation of an error that all of zero_in_use have in common"
    if index:
        gauge = gauge_names[int(index[:-1]) - 1]
        text = f"Zero of gauge {gauge} that is subtracted from strain[{index}: the last tare's, or zero[{index}"
        if array != ZEROS_IN_USE[0]:
            text = f"Standard deviation of the error of zero_in_use[{index}, of gauge {gauge}"
    return Variable(
        name=name,
        description=text,
        causality="local",
        kind="parameter",
        variability="discrete",
        unit="1",
        display_unit="um/m",
        minimum=-LARGEST_ZERO if array == ZEROS_IN_USE[0] else 0.0,
        maximum=LARGEST_ZERO,
        array=array if index else None,
    )
