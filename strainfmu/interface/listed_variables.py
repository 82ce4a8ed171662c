"""Which variables the description of an estimator FMU lists, and in what order.

The libraries know every variable of :func:`~strainfmu.interface.estimator_variables.estimator_interface` by its
number there, listed or not.
"""

from collections.abc import Collection, Sequence
from dataclasses import replace

from strainfmu.estimator.air_inputs import (
    AIR_INPUT_NAMES,
    ALTITUDE,
    DYNAMIC_PRESSURE,
    MACH_NUMBER,
    Q_SOURCE,
    STATIC_PRESSURE,
)
from strainfmu.estimator.other_loads import ROLLING
from strainfmu.estimator.signal_names import COEFFICIENT_ARRAY, FORCE, MOMENT, VALID
from strainfmu.interface.fmi_variables import Variable
from strainfmu.interface.zero_variables import zero_in_use_names, zero_names

_VALUES = (COEFFICIENT_ARRAY, FORCE, MOMENT, ROLLING, "moment.roll")
"""Arrays and variables that come first, because FMI tools plot what comes first."""


def without_zeros(interface: Sequence[Variable], n_gauges: int) -> tuple[Variable, ...]:
    """Return a list of scalars without zeros, their standard deviations, and what a tare has made of them.

    They are four of seven variables of an FMU with 54 gauges.
    """
    return _without(interface, {*zero_names(n_gauges), *zero_in_use_names(n_gauges)})


_MINIMAL_AIR_INPUTS = (DYNAMIC_PRESSURE, MACH_NUMBER, ALTITUDE, STATIC_PRESSURE, Q_SOURCE)
"""Air data that most hosts have; the others have start values that stand for not known."""


def with_minimal_inputs(interface: Sequence[Variable]) -> tuple[Variable, ...]:
    """Return scalars or arrays without the inputs ``valid`` and the air data that few hosts have.

    A lost gauge is a strain of NaN then. What the map needs in addition, as temperatures, is there.
    """
    few = {*AIR_INPUT_NAMES}.difference(_MINIMAL_AIR_INPUTS)
    return _without(
        interface, few | {variable.name for variable in interface if VALID in (variable.array, variable.name)}
    )


def fed_by_frames(interface: Sequence[Variable]) -> tuple[Variable, ...]:
    """Return outputs, which change at events, and parameters, of an FMU whose inputs come in frames."""
    inputs = {variable.name for variable in interface if variable.causality == "input"}
    return tuple(
        replace(variable, variability="discrete") if variable.causality == "output" else variable
        for variable in _without(interface, inputs)
    )


def _without(interface: Sequence[Variable], left_out: Collection[str]) -> tuple[Variable, ...]:
    """Return ``interface`` without some variables, on which no other depends then."""

    def listed(names: tuple[str, ...]) -> tuple[str, ...]:
        return tuple(name for name in names if name not in left_out)

    return tuple(
        replace(
            variable,
            depends_on=listed(variable.depends_on),
            initially_depends_on=listed(variable.initially_depends_on),
        )
        for variable in interface
        if variable.name not in left_out
    )


def most_important_first(interface: Sequence[Variable]) -> tuple[Variable, ...]:
    """Return scalars or arrays in the order of a tool's list.

    Coefficients and loads, air data, health, what a host connects, standard deviations, details; each group in the
    order of ``interface``.
    """
    return tuple(sorted(interface, key=_group))


def _group(variable: Variable) -> int:
    if (variable.array or variable.name) in _VALUES:
        return 0
    if variable.name.startswith("air_data."):
        return 1
    if variable.name.startswith("health."):
        return 2
    if variable.causality == "input" and variable.fmi_type == "Real":
        return 3
    return 4 if variable.name.startswith("sigma.") else 5
