"""Parameters of an FMU for the zeros of its gauges, and how well they are known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from strainfmu.estimator.gauge_zeros import LARGEST_ZERO
from strainfmu.estimator.signal_names import ZERO, ZERO_COMMON_STD, ZERO_STD
from strainfmu.interface.fmi_variables import Variable
from strainfmu.interface.health_names import VALID_GAUGES

ZERO_ARRAYS = {
    ZERO: "Reading of each gauge without strain, taken off its strain; same order as strain",
    ZERO_STD: "Standard deviation of the error of each zero, independent of the others",
}


def zero_names(n_gauges: int) -> tuple[str, ...]:
    """Return the names of zeros, of their sigmas, and of the sigma that they have in common."""
    numbers = range(1, n_gauges + 1)
    return (*(f"zero[{i}]" for i in numbers), *(f"zero_std[{i}]" for i in numbers), ZERO_COMMON_STD)


def with_zero_parameters(
    interface: Sequence[Variable], gauge_names: Sequence[str], zero_offset: Sequence[float]
) -> tuple[Variable, ...]:
    """Return ``interface`` with the zeros of the gauges behind it, on which all outputs depend but one.

    The zeros start from ``zero_offset``, the map's [m/m]. The number of gauges in use follows from the readings as
    they come.
    """
    names = zero_names(len(gauge_names))
    start = dict(zip(names, zero_offset, strict=False))
    outputs = tuple(
        replace(variable, initially_depends_on=(*variable.initially_depends_on, *names))
        if variable.causality == "output" and variable.name != VALID_GAUGES
        else variable
        for variable in interface
    )
    return (*outputs, *(_parameter(name, gauge_names, start.get(name, 0.0)) for name in names))


def _parameter(name: str, gauge_names: Sequence[str], start: float) -> Variable:
    array, _, index = name.partition("[")
    text = "Standard deviation of an error that all zeros have in common"
    if index:
        gauge = gauge_names[int(index[:-1]) - 1]
        text = f"Reading of gauge {gauge} without strain, taken off strain[{index}"
        if array == ZERO_STD:
            text = f"Standard deviation of the error of zero[{index}, of gauge {gauge}"
    return Variable(
        name=name,
        description=text,
        causality="parameter",
        kind="parameter",
        variability="tunable",
        unit="1",
        display_unit="um/m",
        minimum=-LARGEST_ZERO if array == ZERO else 0.0,
        maximum=LARGEST_ZERO,
        start=start,
        array=array if index else None,
    )
