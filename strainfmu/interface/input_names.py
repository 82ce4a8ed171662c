"""Names of the estimator's inputs and parameters, and what stands for a value that is not known."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import inf, nan

from strainfmu.estimator.arguments import NOT_KNOWN as NOT_KNOWN

FLOW_INPUTS = ("dynamic_pressure", "dynamic_pressure_std", "mach_number", "altitude")
"""Flow and navigation, the further arguments of :meth:`strainfmu.estimator.linear.estimator.Estimator.step`."""

PARAMETERS = ("sensor_range", "alarm_scale", "reference_area", "reference_length", "moment_station")
"""Tunable parameters, the entries of :class:`~strainfmu.estimator.settings.EstimatorSettings`."""


NAVIGATION_INPUTS = ("mach_number_std", "static_pressure", "static_pressure_std")
"""Further navigation of a map with tables over the flight state, as :data:`FLOW_INPUTS`."""

FURTHER_FLOW = (FLOW_INPUTS[1], *NAVIGATION_INPUTS)
"""Deviations of q_inf and navigation, and p_inf: what not every sender knows, and not every estimator takes."""


def known_flow(values: Sequence[float]) -> tuple[float, ...]:
    """Return ``values`` of :data:`FLOW_INPUTS`, NaN for those that are not known."""
    return tuple(nan if value == NOT_KNOWN else value for value in values)


def without_negative_deviations(flow: Mapping[str, float]) -> dict[str, float]:
    """Return ``flow`` with an infinite deviation, whose value counts as not known, for each negative one."""
    return {name: inf if name.endswith("_std") and value < 0.0 else value for name, value in flow.items()}
