"""The parameter of an FMU whose estimator can be filtered over time: the time constant, 0 for none."""

from __future__ import annotations

from typing import TYPE_CHECKING

from strainfmu.estimator.map.inverse_map import has_filter
from strainfmu.estimator.policies import LARGEST_TIME as LARGEST
from strainfmu.estimator.policies import SMALLEST_TIME as SMALLEST
from strainfmu.estimator.signal_names import FILTER_TIME_CONSTANT as FILTER_TIME_CONSTANT
from strainfmu.interface.fmi_variables import Variable

if TYPE_CHECKING:
    from strainfmu.estimator.map.inverse_map import InverseMap


def with_filter_parameter(interface: tuple[Variable, ...], inverse_map: InverseMap) -> tuple[Variable, ...]:
    """Return ``interface`` with the time constant behind it, where there is a filter."""
    if not has_filter(inverse_map):
        return interface
    none = "0, or model exchange," if inverse_map.manifold is None else "0"
    parameter = Variable(
        name=FILTER_TIME_CONSTANT,
        description=f"Longest time over which the filter averages estimates of single samples; {none} for none",
        causality="parameter",
        kind="parameter",
        variability="tunable",
        unit="s",
        minimum=0.0,
        maximum=LARGEST,
        start=0.0,
    )
    return (*interface, parameter)


def time_constant_fault(value: float) -> str:
    """Return what is wrong with a time constant [s], nothing if it may be set."""
    if value == 0.0 or SMALLEST <= value <= LARGEST:
        return ""
    return f"{FILTER_TIME_CONSTANT}: {value:g} found, must be 0 or between {SMALLEST:g} and {LARGEST:g}"
