"""Names of the estimator's inputs and parameters, and what stands for a value that is not known."""

from collections.abc import Mapping, Sequence
from math import isfinite, nan
from typing import TypeVar

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.estimator.air_inputs import (
    AIR_INPUTS,
    FLOW_QUANTITIES,
    INERTIAL_NAMES,
    MEASURED_ANGLES,
    SAMPLE_INPUTS,
    STD,
)
from strainfmu.estimator.air_inputs import FLOW_INPUTS as FLOW_INPUTS
from strainfmu.estimator.air_inputs import LAST_INPUTS as LAST_INPUTS
from strainfmu.estimator.air_inputs import NAVIGATION_INPUTS as NAVIGATION_INPUTS
from strainfmu.estimator.settings import SETTING_NAMES
from strainfmu.estimator.signal_names import NOT_KNOWN as NOT_KNOWN
from strainfmu.estimator.signal_names import THRUST
from strainfmu.flight_condition import with_unit

NOT_GIVEN = "0 or below (or NaN)"
"""What :data:`FLOW_INPUTS`, :data:`NAVIGATION_INPUTS` and temperatures are where they are not given, in words.

Hosts fill in 0 for inputs that nothing is connected to, and all of them are positive.
"""

PARAMETERS = SETTING_NAMES
"""Tunable parameters, the entries of :class:`~strainfmu.estimator.settings.EstimatorSettings`."""


OTHER_AIR_DATA = (
    *(name for name in FLOW_INPUTS if name.endswith(STD)),
    *NAVIGATION_INPUTS,
    *LAST_INPUTS,
    *INERTIAL_NAMES,
)
"""Deviations, p_inf, sources, angles and inertial inputs: what not every sender knows, and not every
estimator takes."""


def other_air_data(*, is_nonlinear: bool, has_masses: bool) -> tuple[str, ...]:
    """Return the names in :data:`OTHER_AIR_DATA` that an estimator takes.

    Mach number and pressures are of nonlinear ones, inertial inputs of maps with masses.
    """
    not_taken = {*(() if is_nonlinear else NAVIGATION_INPUTS), *(() if has_masses else INERTIAL_NAMES)}
    return tuple(name for name in OTHER_AIR_DATA if name not in not_taken)


_SIGNED = {sample_input.name for sample_input in SAMPLE_INPUTS if sample_input.is_signed}


FLOW_KEYS = {
    air_input.name: with_unit(air_input.name, air_input.unit)
    for air_input in AIR_INPUTS
    if air_input.name in FLOW_QUANTITIES
}
"""Keys of the flow in the datagrams of a bridge, by name: they end on the unit."""


Value = TypeVar("Value", float, FloatArray)


def given_flow(flow: Mapping[str, Value]) -> dict[str, Value]:
    """Return ``flow``, values of :data:`AIR_INPUTS` by name, NaN where not given.

    What comes over a wire, from a file or from a host has no other word for that than 0. So a standard deviation
    of 0 takes the map's own. Angles may be 0: they are not given where they are :data:`NOT_KNOWN`.
    """
    return {name: _given(value, name in _SIGNED) for name, value in flow.items()}


def lone_angle(inputs: Mapping[str, float]) -> str:
    """Return in a line which angle among the ``inputs`` of an FMU does not count for want of a standard deviation.

    "" for none; an angle of 0 is an input that nothing is connected to.
    """
    for name in MEASURED_ANGLES:
        angle = inputs[name]
        if isfinite(angle) and angle not in (0.0, NOT_KNOWN) and not inputs[f"{name}{STD}"] > 0.0:
            return f"{name} = {angle:g} rad does not count: {name}{STD} must be above 0"
    return ""


def given_to_fmu(inputs: Mapping[str, float]) -> dict[str, float]:
    """Return what :func:`given_flow` does, for an FMU: angles without standard deviation are not given."""
    without = {name for name in MEASURED_ANGLES if not inputs[f"{name}{STD}"] > 0.0}
    return {name: nan if name in without else value for name, value in given_flow(inputs).items()}


def _given(value: Value, is_signed: bool) -> Value:
    if is_signed:
        if isinstance(value, float):
            return nan if value == NOT_KNOWN else value
        return np.where(value == NOT_KNOWN, nan, value)
    if isinstance(value, float):
        return value if value > 0.0 else nan
    return np.where(value > 0.0, value, nan)


def given_thrust(inputs: Mapping[str, float]) -> dict[str, float]:
    """Return the argument ``thrust`` [N] of an estimator from ``inputs`` by name, 0 without one."""
    return {THRUST: known_values([inputs.get(THRUST, 0.0)])[0]}


def known_values(values: Sequence[float]) -> tuple[float, ...]:
    """Return ``values`` of flow parameters, or of thrust, NaN for those that are not known."""
    return tuple(nan if value == NOT_KNOWN else value for value in values)
