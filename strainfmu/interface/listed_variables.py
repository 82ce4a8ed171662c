"""Which variables the description of an estimator FMU lists, and in what order.

The libraries know every variable of :func:`~strainfmu.interface.estimator_variables.estimator_interface` by its
number there, listed or not.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from strainfmu.estimator.other_loads import ROLLING
from strainfmu.estimator.signal_names import COEFFICIENT_ARRAY, FORCE, MOMENT
from strainfmu.interface.fmi_variables import Variable
from strainfmu.interface.tare_variables import zero_in_use_names
from strainfmu.interface.zero_variables import zero_names

_VALUES = (COEFFICIENT_ARRAY, FORCE, MOMENT, ROLLING, "moment.roll")
"""Arrays and variables that come first, because FMI tools plot what comes first."""


def without_zeros(interface: Sequence[Variable], n_gauges: int) -> tuple[Variable, ...]:
    """Return a list of scalars without zeros, their standard deviations, and what a tare has made of them.

    They are four of seven variables of an FMU with 54 gauges.
    """
    left_out = {*zero_names(n_gauges), *zero_in_use_names(n_gauges)}
    return tuple(
        replace(one, initially_depends_on=tuple(name for name in one.initially_depends_on if name not in left_out))
        for one in interface
        if one.name not in left_out
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
